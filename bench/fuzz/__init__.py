"""Damaged and hostile inputs for everything that reads: `python bench/fuzz`."""
