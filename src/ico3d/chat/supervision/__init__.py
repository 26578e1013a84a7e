"""Handling of failed services: the avatar apologises, the turn ends, and the next one works."""
