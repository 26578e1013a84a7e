"""Putting a head on a body: alignment, colours, the seam (paper, head–body integration)."""
