"""Which of a project's holdings belong to a person, and what is left for people to look at."""

import os
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence, Set
from pathlib import Path

from ico3d.avatar.forgetting.holdings import Holding

ELSEWHERE = (
    "copies of bundles that were served, given away, embedded or packed into archives, and what "
    "visitors' browsers kept",
    "films, pictures, reports and exported splats that were made of the person",
    "backups, the history of version control, and copies on other machines",
    "voices cloned from recordings that settings name (~/.cache/ico3d/voices)",
)
"""What no folder can tell of."""


def belonging(holdings: Sequence[Holding], paths: Sequence[Path], names: Set[str]) -> list[Holding]:
    """What belongs to a person: what is named, whoever it shows, and all that was made of it.

    Args:
        holdings: Everything in the project.
        paths: Recordings, models, bundles or folders that are named, absolute.
        names: The person's names, as they are compared.
    """
    shown = [one.names for one in holdings]
    named = set(map(os.fspath, paths))
    chosen = {at for at, one in enumerate(holdings) if _holder(one.path, named)}
    theirs = [shown[at] for at in chosen if shown[at]]
    if len(set().union(*theirs)) == 1:  # somebody else in the same avatar is not meant
        names = names | theirs[0]
    chosen |= {at for at, found in enumerate(shown) if found & names}
    made = _Made(holdings)
    origins = [*paths, *(holdings[at].path for at in chosen)]
    while origins:  # what was made of a model that was made of a recording
        more = made.of(origins.pop()) - chosen
        chosen |= more
        origins += (holdings[at].path for at in more)
    return [holdings[at] for at in sorted(chosen)]


def outermost(paths: Sequence[Path]) -> list[Path]:
    """The paths without those that lie below another of them, each once, sorted."""
    texts = set(map(os.fspath, paths))
    return sorted(path for path in set(paths) if not _holder(path.parent, texts))


def within(paths: Iterable[Path], holdings: Iterable[Holding]) -> dict[Path, list[Holding]]:
    """By each of some paths, of which none lies below another, the holdings that it holds."""
    found: dict[str, list[Holding]] = {os.fspath(path): [] for path in paths}
    for one in holdings:
        if (holder := _holder(one.path, found.keys())) is not None:
            found[holder].append(one)
    return {Path(path): inside for path, inside in found.items()}


def remaining(
    holdings: Sequence[Holding], chosen: Sequence[Holding], gone: Sequence[Path]
) -> Iterator[str]:
    """Sentences on what is still there after `gone` was removed.

    Args:
        holdings: Everything that was in the project.
        chosen: What belonged to the person.
        gone: All paths that were removed.
    """
    removed = set(map(os.fspath, gone))
    for origin in dict.fromkeys(path for one in chosen for path in one.made_of):
        if not _holder(origin, removed) and os.path.exists(origin):
            yield f"{origin}, of which something was made that is gone"
    for source in dict.fromkeys(source for one in chosen for source in one.sources):
        yield f"what a recording was made from: {source}"
    told = {os.fspath(one.path) for one in holdings if one.likenesses}
    for one in holdings:
        # neither itself, nor what it lies in or was made of, says whom it shows
        silent = not any(_holder(path, told) for path in (one.path, *one.made_of))
        if silent and not _holder(one.path, removed):
            yield f"{one.path}, {one.what} that does not say whom it shows: look at it"
    yield from ELSEWHERE


class _Made:
    """What was made of which paths; others' folders may tell of thousands, each made of another."""

    def __init__(self, holdings: Sequence[Holding]):
        """Sorts the paths of which holdings were made, so that those in a folder lie together."""
        pairs = ((_inside(made), at) for at, one in enumerate(holdings) for made in one.made_of)
        self._sorted = sorted(pairs)

    def of(self, origin: Path) -> set[int]:
        """Numbers of the holdings that were made of a path, or of what lies below it."""
        begin, found = _inside(origin), set()
        at = bisect_left(self._sorted, (begin, 0))
        while at < len(self._sorted) and self._sorted[at][0].startswith(begin):
            found.add(self._sorted[at][1])
            at += 1
        return found


def _inside(path: Path) -> str:
    """How the paths of all begin that lies in a folder, of which the folder itself is one."""
    return f"{path}{os.sep}"


def _holder(path: Path, among: Set[str]) -> str | None:
    """The innermost of some paths that is this one, or in which it lies; None where none is."""
    text = os.fspath(path)
    while text and text not in among:
        text = text.rpartition(os.sep)[0]
    return text or None
