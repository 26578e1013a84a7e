"""Bodies of windows: their entry in the manifest, and their files."""
