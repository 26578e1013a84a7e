"""The body model brought to what was seen."""
