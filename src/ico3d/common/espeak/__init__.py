"""Speech synthesis with espeak-ng, in a process of its own."""
