"""Evidence about a person from pictures: points on which cameras agree, and outlines."""
