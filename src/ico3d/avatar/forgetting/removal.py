"""Removes files and folders, and says what that could not reach."""

import os
from collections.abc import Sequence
from pathlib import Path

from ico3d.capture.headpose.track_file import track_file as head_track_file
from ico3d.common.files import remove_folder, walk
from ico3d.errors import SettingsError
from ico3d.rig.body_track import track_file as body_track_file
from ico3d.training.listing.find_runs import ABOUT
from ico3d.training.notes.lock import is_locked


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


def remove(paths: Sequence[Path]) -> list[str]:
    """Removes files and folders for good; links are removed, not what they lead to.

    Args:
        paths: None of them lies in another one.

    Returns:
        A sentence for each link, on what it led to.

    Raises:
        SettingsError: If something cannot be removed; all else is gone then.
    """
    left, targets = [], []
    for path in paths:
        try:
            if os.path.islink(path):
                targets.append(f"{os.path.realpath(path)}, to which {path} led")
                path.unlink()
            elif os.path.isdir(path):
                targets += _links_in(path)
                if faults := remove_folder(path):
                    raise faults[0]
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            left.append(f"{path} ({error.strerror})")
    if left:
        raise SettingsError(f"all is gone but {', '.join(left)}: it cannot be removed.")
    return targets


def _links_in(folder: Path) -> list[str]:
    """A sentence for each link below a folder, on what it leads to."""
    found = []
    for place, folders, files in walk(folder):
        links = (place / name for name in (*folders, *files))
        found += [
            f"{os.path.realpath(one)}, to which {one} led" for one in links if os.path.islink(one)
        ]
    return found
