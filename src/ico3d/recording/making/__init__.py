"""Makes an avatar of what was recorded, in a process of its own, and lets people talk with it."""
