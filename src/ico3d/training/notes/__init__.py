"""What a run folder tells while and after somebody trains in it: its command, its steps, its end."""
