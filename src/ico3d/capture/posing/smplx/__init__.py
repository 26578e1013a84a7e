"""Body tracks from SMPL-X parameters that a recording brings, and the user's own model file."""
