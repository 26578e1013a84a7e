"""Links in strangers' folders of which a system, or Python, says no more than that it will not."""

from pathlib import Path

ODD_LINKS = ["long", "itself", "chain"]
"""To a name longer than names may be, to itself, and to a link to a link and so on."""
CHAIN = 1200
"""Links of a chain: as many as there are calls on Python's stack, and more."""


def odd_link(place: Path, kind: str) -> None:
    """Makes one."""
    if kind == "chain":
        beside = [place.with_name(f".{place.name}{number}") for number in range(CHAIN)]
        for one, other in zip(beside, [*beside[1:], place.with_name("end")], strict=True):
            one.symlink_to(other.name)
        place.symlink_to(beside[0].name)
    else:
        place.symlink_to("n" * 300 if kind == "long" else place.name)
