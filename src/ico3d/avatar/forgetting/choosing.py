"""Which of a project's holdings belong to a person, and what is left for people to look at."""

from collections.abc import Iterator, Sequence, Set
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
    chosen = [one for one in holdings if any(map(one.lies_in, paths))]
    shown = [one.names for one in chosen if one.names]
    if len(set().union(*shown)) == 1:  # somebody else in the same avatar is not meant
        names = names | shown[0]
    chosen = [one for one in holdings if one in chosen or one.names & names]
    count = -1
    while count != len(chosen):  # what was made of a model that was made of a recording
        count = len(chosen)
        origins = [*paths, *(one.path for one in chosen)]
        chosen = [one for one in holdings if one in chosen or _is_made_of(one, origins)]
    return chosen


def outermost(paths: Sequence[Path]) -> list[Path]:
    """The paths without those that lie below another of them, each once, sorted."""
    apart = sorted(set(paths))
    return [path for path in apart if not any(other in path.parents for other in apart)]


def remaining(
    holdings: Sequence[Holding], chosen: Sequence[Holding], gone: Sequence[Path]
) -> Iterator[str]:
    """Sentences on what is still there after `gone` was removed.

    Args:
        holdings: Everything that was in the project.
        chosen: What belonged to the person.
        gone: All paths that were removed.
    """
    for origin in dict.fromkeys(path for one in chosen for path in one.made_of):
        if not any(map(origin.is_relative_to, gone)) and origin.exists():
            yield f"{origin}, of which something was made that is gone"
    for source in dict.fromkeys(source for one in chosen for source in one.sources):
        yield f"what a recording was made from: {source}"
    for one in holdings:
        if not any(map(one.lies_in, gone)) and _is_silent(one, holdings):
            yield f"{one.path}, {one.what} that does not say whom it shows: look at it"
    yield from ELSEWHERE


def _is_silent(holding: Holding, holdings: Sequence[Holding]) -> bool:
    """Whether neither a holding, nor what it lies in or was made of, says whom it shows."""
    near = [holding.path, *holding.made_of]
    return not any(
        other.likenesses and path.is_relative_to(other.path) for other in holdings for path in near
    )


def _is_made_of(holding: Holding, origins: Sequence[Path]) -> bool:
    return any(made.is_relative_to(origin) for made in holding.made_of for origin in origins)
