"""What a webcam does wrong when it records a synthetic person."""
