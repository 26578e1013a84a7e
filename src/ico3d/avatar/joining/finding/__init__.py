"""Where the face of a head is, and where the head is in a body's recording, by looking."""
