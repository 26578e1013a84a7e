"""Looks at a video before anything is made of it: what would make it better, and when."""
