"""Lists the runs in a folder: how far they are, what stopped them, by which command they go on."""
