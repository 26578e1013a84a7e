"""How the built-in speech encoder is trained, on synthetic voices."""
