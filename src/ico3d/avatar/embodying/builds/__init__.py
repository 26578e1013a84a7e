"""Other builds of a body that was recorded in one: a smooth change of its surface at rest."""
