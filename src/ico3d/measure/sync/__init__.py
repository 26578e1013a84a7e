"""Sync-C, Sync-D and offset: how well lips and sound of a video fit, as SyncNet sees them."""
