"""Pictures for training: read ahead of the step that needs them, kept in memory or on a disk."""
