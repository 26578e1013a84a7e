"""What pictures say about a person: points that cameras agree on, and outlines."""
