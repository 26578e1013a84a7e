"""Writes folders of recordings so that none is ever half there."""
