"""Looks at files of anybody before a library opens them, which would take too much."""
