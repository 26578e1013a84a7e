"""The table of weights."""
