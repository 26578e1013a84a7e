"""Gives a head that was made alone the body of another person, as a stand-in."""
