"""Removes files and folders, and says what that could not reach."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from ico3d.capture.headpose.track_file import track_file as head_track_file
from ico3d.errors import SettingsError
from ico3d.rig.body_track import track_file as body_track_file


def with_tracks(paths: Sequence[Path]) -> list[Path]:
    """The paths, and beside recordings that are files the tracks of head and body."""
    beside = [track(path) for path in paths for track in (head_track_file, body_track_file)]
    return [*paths, *(file for file in beside if file.is_file())]


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
            if path.is_symlink():
                targets.append(f"{path.resolve()}, to which {path} led")
                path.unlink()
            elif path.is_dir():
                targets += _links_in(path)
                shutil.rmtree(path)
            else:
                path.unlink()
        except OSError as error:
            left.append(f"{path} ({error.strerror})")
    if left:
        raise SettingsError(f"all is gone but {', '.join(left)}: it cannot be removed.")
    return targets


def _links_in(folder: Path) -> list[str]:
    """A sentence for each link below a folder, on what it leads to."""
    found = []
    for place, folders, files in os.walk(folder):
        links = (Path(place, name) for name in (*folders, *files))
        found += [f"{one.resolve()}, to which {one} led" for one in links if one.is_symlink()]
    return found
