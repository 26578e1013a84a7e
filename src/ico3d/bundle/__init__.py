"""The deployable avatar: its file, the checks of that file, and the reference evaluator."""
