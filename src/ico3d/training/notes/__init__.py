"""What a run tells of itself: who works at it, its command, its steps, its end."""
