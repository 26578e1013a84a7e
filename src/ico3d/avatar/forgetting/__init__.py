"""Removes what a project folder holds of a person."""
