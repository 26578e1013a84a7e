"""Whose likeness a bundle is, and who agreed to it."""
