"""Listing and downloading pretrained weights."""
