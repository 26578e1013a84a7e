"""What makes synthetic people differ: glasses, beards, loose hair, dark skin, a child's head."""
