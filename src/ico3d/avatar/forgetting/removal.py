"""Removes files and folders, and says what that could not reach."""

import os
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

from ico3d.capture.headpose.track_file import track_file as head_track_file
from ico3d.common.files import remove_folder, resolved, walk
from ico3d.errors import SettingsError
from ico3d.rig.body_track import track_file as body_track_file
from ico3d.training.listing.find_runs import ABOUT
from ico3d.training.notes.lock import is_locked

GONE = re.compile(r"\.(.+)\.[0-9a-f]{16}\.gone")
"""Names of what is being removed of somebody, whose name is in it, as `ico3d studio` hides it."""
MOST_TOLD = 100
"""Links of which it is said what they led to."""


def with_tracks(paths: Sequence[Path]) -> list[Path]:
    """The paths, and beside recordings that are files the tracks of head and body."""
    beside = [track(path) for path in paths for track in (head_track_file, body_track_file)]
    return [*paths, *(file for file in beside if os.path.isfile(file))]


def check_idle(paths: Sequence[Path]) -> None:
    """Refuses to remove what a process works at: it would write there again.

    Raises:
        SettingsError: If one does; the sentence names the folder.
    """
    for path in paths:
        for place, _, files in walk(path) if not os.path.islink(path) else ():
            locks = [place / name for name in ABOUT.values() if name in files]
            if any(map(is_locked, (place, *locks))):
                raise SettingsError(
                    f"a process works at {place} just now, and would write there again: wait for "
                    "its end, or end it. Nothing was removed."
                )


def remove(paths: Sequence[Path]) -> None:
    """Removes files and folders for good; links are removed, not what they lead to.

    Args:
        paths: None of them lies in another one.

    Raises:
        SettingsError: If something cannot be removed; all else is gone then.
    """
    left = []
    for path in paths:
        try:
            if os.path.isdir(path) and not os.path.islink(path):
                if fault := remove_folder(path):
                    raise fault
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            left.append(f"{path} ({error.strerror})")
    if left:
        raise SettingsError(f"all is gone but {', '.join(left)}: it cannot be removed.")


def links_in(paths: Sequence[Path]) -> list[str]:
    """A sentence on what a link leads to, for the first `MOST_TOLD` among paths and below."""
    found = []
    for link in islice(_links(paths), MOST_TOLD + 1):
        if len(found) == MOST_TOLD:
            return [*found, "what further links led to"]
        found.append(f"{resolved(link)}, to which {link} led")
    return found


def _links(paths: Sequence[Path]) -> Iterator[Path]:
    for path in paths:
        if os.path.islink(path):
            yield path
            continue
        for place, folders, files in walk(path):
            yield from (place / one for one in (*folders, *files) if os.path.islink(place / one))
