"""Damages sound files in ways that get past the first check of a reader."""
