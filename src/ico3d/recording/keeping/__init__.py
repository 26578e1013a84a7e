"""What is recorded of people: their consent and their parts, as plain files."""
