"""Fits the body model to landmarks and outlines that were seen."""
