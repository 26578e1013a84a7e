"""Weights that are listed and downloaded."""
