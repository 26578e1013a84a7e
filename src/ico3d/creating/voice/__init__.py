"""The voice of an avatar, cloned from the recording that its face is made of."""
