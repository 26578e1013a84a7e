"""Removes files and folders, and says what that could not reach."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from ico3d.capture.headpose.track_file import track_file as head_track_file
from ico3d.common.files import walk
from ico3d.errors import SettingsError
from ico3d.rig.body_track import track_file as body_track_file
from ico3d.training.listing.find_runs import ABOUT
from ico3d.training.notes.lock import is_locked


def with_tracks(paths: Sequence[Path]) -> list[Path]:
    """The paths, and beside recordings that are files the tracks of head and body."""
    beside = [track(path) for path in paths for track in (head_track_file, body_track_file)]
    return [*paths, *(file for file in beside if file.is_file())]


def check_idle(paths: Sequence[Path]) -> None:
    """Refuses to remove what a process works at: it would write there again.

    Raises:
        SettingsError: If one does; the sentence names the folder.
    """
    for path in paths:
        for place, _, files in walk(path) if not path.is_symlink() else ():
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
            if path.is_symlink():
                targets.append(f"{path.resolve()}, to which {path} led")
                path.unlink()
            elif path.is_dir():
                targets += _links_in(path)
                _remove_folder(path)
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            left.append(f"{path} ({error.strerror})")
    if left:
        raise SettingsError(f"all is gone but {', '.join(left)}: it cannot be removed.")
    return targets


def _remove_folder(folder: Path) -> None:
    """Removes a folder; what vanishes meanwhile, or cannot be removed, does not save the rest.

    Raises:
        OSError: The first one, if something is left.
    """
    faults: list[OSError] = []

    def go_on(function: object, path: str, about: tuple) -> None:
        del function, path
        if not isinstance(about[1], FileNotFoundError):
            faults.append(about[1])

    try:
        shutil.rmtree(folder, onerror=go_on)
    except RecursionError as error:
        raise OSError(0, "its folders are nested too deep") from error
    if faults:
        raise faults[0]


def _links_in(folder: Path) -> list[str]:
    """A sentence for each link below a folder, on what it leads to."""
    found = []
    for place, folders, files in walk(folder):
        links = (place / name for name in (*folders, *files))
        found += [f"{one.resolve()}, to which {one} led" for one in links if one.is_symlink()]
    return found
