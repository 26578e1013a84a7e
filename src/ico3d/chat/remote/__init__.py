"""Recognition, language, voice and expression as servers for other machines."""
