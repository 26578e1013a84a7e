"""Training of the built-in speech encoder on synthetic voices."""
