"""Targets of links in strangers' folders, of which a system says no more than that it will not."""

ODD_LINKS = ["n" * 300, None]
"""A name longer than names may be; None stands for the link itself."""
