"""Reads packed files of anybody: how much they unpack to is known before it is unpacked."""
