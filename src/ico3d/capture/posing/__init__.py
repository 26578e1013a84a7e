"""Fits a skeleton to a recorded person, from the pictures of several cameras or of one."""
