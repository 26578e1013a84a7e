"""Tells the operator which sites' pages were refused; those pages stay empty without a word."""

from loguru import logger

from ico3d.chat.serving.sites import is_embedded
from ico3d.chat.settings.embedding import check_origin
from ico3d.errors import SettingsError

MOST = 20
"""Sites that are told of: strangers can send any origin, and the log is not theirs to fill."""
NO_SITE = "null"  # what browsers send for pages that were opened as files


class Refusals:
    """Says each refused site once, and what would admit it."""

    def __init__(self):
        """Starts without any."""
        self._told: set[str] = set()

    def tell(self, origin: str, path: str) -> None:
        """Says that a page was refused, if nobody was told of its site.

        Args:
            origin: What its browser sent as Origin.
            path: What the page asked for; only what sites embed is told of.
        """
        if len(self._told) >= MOST or origin in self._told or not is_embedded(path):
            return
        sentence = _sentence(origin)
        if sentence is None:
            return
        self._told.add(origin)
        last = " Further sites are not told of." if len(self._told) == MOST else ""
        logger.warning(f"{sentence}{last}")


def _sentence(origin: str) -> str | None:
    """What is said of an origin; None for what no browser sends."""
    if origin == NO_SITE:
        return (
            "a page that belongs to no site was refused, such as one opened as a file: serve it "
            "by HTTP, and name its site with --allow-origin."
        )
    try:
        check_origin(origin)
    except SettingsError:
        return None
    return (
        f"a page of {origin} was refused: only sites that were allowed may embed the avatar. "
        f"`--allow-origin {origin}` allows it."
    )
