"""Finds the face of a head, and the head in a body's recording, by tracking faces in pictures."""
