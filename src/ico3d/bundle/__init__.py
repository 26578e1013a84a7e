"""The deployable avatar: its file format, checks, reference evaluator and planner of motion."""
