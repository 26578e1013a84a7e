"""What is stated of recorded people."""
