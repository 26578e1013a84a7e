"""Whole people: a head joined to a body, gestures, films, and the bundle that is deployed."""
