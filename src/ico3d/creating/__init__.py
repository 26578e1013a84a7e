"""From one video to an avatar: what the verbs do one by one, in one go."""
