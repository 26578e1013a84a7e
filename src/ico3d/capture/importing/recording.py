"""Makes a multiview folder from a recording that another program has calibrated."""

import os
import re
import shutil
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.capture.importing.colmap import is_model, read_colmap
from ico3d.capture.importing.foreign import Foreign, Shot
from ico3d.capture.importing.settings import ImportSettings
from ico3d.capture.importing.transforms import read_transforms
from ico3d.capture.multiview.description import Description, Place
from ico3d.capture.multiview.reader import MultiviewCapture
from ico3d.capture.multiview.writing import shown
from ico3d.capture.poses import nearest_axis, turn_upright, turned, up_of_cameras
from ico3d.capture.vetting.claims import MOST_GAPS
from ico3d.capture.writing.new_folder import check_room, new_folder
from ico3d.common.files import resolved
from ico3d.errors import CaptureError

NEARLY = np.cos(np.radians(20))
"""Cosine of the angle (20°) up to which an axis of the source counts as the upward direction."""
UNEVEN = 0.1
"""Share of a frame's duration by which times may deviate from an even rate."""


def import_recording(source: Path, out: Path, settings: ImportSettings) -> Description:
    """Copies a recording into a multiview folder, which appears only once it is complete.

    Args:
        source: A COLMAP model or a folder around one, or a transforms.json or its folder.
        out: Folder to make.
        settings: What the source does not say itself.

    Returns:
        The contents of the new `cameras.json`.

    Raises:
        CaptureError: If `out` exists, the source is of an unknown kind, or a file is damaged.
    """
    foreign = _read(source, settings.images)
    cameras, frames = _grouped(foreign)
    turn = _upright(foreign)
    places = tuple(
        Place(replace(shots[0].lens, name=name), _world_to_camera(shots[0], turn, settings.scale))
        for name, shots in zip(_names(cameras), cameras, strict=True)
    )
    count = max(max(row) for row in frames) + 1
    sources = (f"{foreign.tool}: {resolved(source).name}",)
    told = (settings.consent, settings.licence, settings.shows, settings.likeness)
    about = Description(settings.fps, count, places, sources, *told)
    with new_folder(out, settings.likeness, sources) as work:
        _copy(work, places, cameras, frames)
        if foreign.points is not None:
            points = (settings.scale * foreign.points @ turn.T).astype(np.float32)
            check_room(work, points.nbytes)
            (work / "points").mkdir()
            np.save(work / "points" / "000000.npy", points)
        about.write(work)
        MultiviewCapture(work)  # what cannot be opened, such as a wild lens, is not written
    return about


def _read(source: Path, images: Path | None) -> Foreign:
    """Finds out what the source is."""
    if not os.path.exists(source):
        raise CaptureError(f"there is nothing at {source}.")
    transforms = source / "transforms.json" if os.path.isdir(source) else source
    if transforms.suffix == ".json" and os.path.isfile(transforms):
        return read_transforms(transforms)
    below = (".", "sparse/0", "sparse", "colmap/sparse/0", "distorted/sparse/0")
    model = next((source / name for name in below if is_model(source / name)), None)
    if model is None:
        raise CaptureError(
            f"{source} holds neither transforms.json nor a COLMAP model (cameras.bin and "
            "images.bin, or .txt)."
        )
    return read_colmap(model, images or _images_near(source, model))


def _images_near(source: Path, model: Path) -> Path:
    """The folder of pictures that belongs to a COLMAP model."""
    above = resolved(model).parents
    places = [folder / "images" for folder in (source, *above[:3])]
    found = next((folder for folder in places if os.path.isdir(folder)), None)
    if found is None:
        raise CaptureError(
            f"{source} has no folder 'images': name that of the pictures (--images)."
        )
    return found


def _grouped(foreign: Foreign) -> tuple[list[list[Shot]], list[list[int]]]:
    """Pictures by camera, and the frame of each; shots of one moment are cameras of their own."""
    numbers = _frame_numbers(foreign)
    if numbers is None:
        return [[shot] for shot in foreign.shots], [[0] for _ in foreign.shots]
    cameras: dict[tuple, dict[int, Shot]] = {}
    for shot, frame in zip(foreign.shots, numbers, strict=True):
        lens = shot.lens
        key = (lens.width, lens.height, lens.intrinsics.tobytes(), lens.distortion)
        taken = cameras.setdefault((*key, shot.camera_to_world.round(9).tobytes()), {})
        if frame in taken:
            raise CaptureError(
                f"{shot.file} and {taken[frame].file} are of one camera and one time."
            )
        taken[frame] = shot
    return [list(c.values()) for c in cameras.values()], [list(c) for c in cameras.values()]


def _frame_numbers(foreign: Foreign) -> list[int] | None:
    """The frame of each picture from its time, or None where there are no times."""
    times = np.array([np.nan if shot.time is None else shot.time for shot in foreign.shots])
    if np.isnan(times).any():
        return None
    moments = np.unique(times.round(9))
    if len(moments) == 1:
        return [0] * len(times)
    steps = (times - moments[0]) / np.diff(moments).min()
    numbers = np.rint(steps)
    if np.abs(steps - numbers).max() > UNEVEN or numbers.max() > MOST_GAPS * len(moments):
        raise CaptureError(
            f"{foreign.tool}: the times of the frames are not evenly spaced: "
            "resample the recording to a constant rate."
        )
    return [int(n) for n in numbers]


def _upright(foreign: Foreign) -> np.ndarray:
    """(3, 3) rotation of the source's world that makes +y up."""
    up = up_of_cameras([shot.camera_to_world for shot in foreign.shots])
    axis = nearest_axis(up)
    return turn_upright(axis if foreign.axes_mean_up and axis @ up > NEARLY else up)


def _world_to_camera(shot: Shot, turn: np.ndarray, scale: float) -> np.ndarray:
    """(4, 4) in the upright world in metres."""
    pose = turned(turn, shot.camera_to_world)
    pose[:3, 3] *= scale
    return np.linalg.inv(pose)


def _names(cameras: list[list[Shot]]) -> list[str]:
    """A name for each camera: of its folder if that is its own, else of its first picture."""
    folders = [{shot.file.parent for shot in shots} for shots in cameras]
    users = Counter(folder for used in folders for folder in used)
    names, taken = list[str](), Counter[str]()
    for shots, used in zip(cameras, folders, strict=True):
        (folder, *more) = used
        own = len(shots) > 1 and not more and users[folder] == 1
        plain = re.sub(r"[^A-Za-z0-9_.-]", "_", folder.name if own else shots[0].file.stem)
        plain = f"camera{plain}" if plain[:1] in (".", "-", "") else plain
        names.append(_free(plain[:80], taken))
    return names


def _free(name: str, taken: Counter[str]) -> str:
    """The name, with a number behind it if it is taken; case does not tell names apart.

    Args:
        name: What is wanted.
        taken: Names in small letters, and the last number that stands behind each; the new one is
            added.
    """
    free = name
    while free.lower() in taken:  # numbers go on where they were: thousands may want one name
        taken[name.lower()] += 1
        free = f"{name}_{taken[name.lower()]}"
    taken[free.lower()] = 1
    return free


def _copy(
    work: Path, places: tuple[Place, ...], cameras: list[list[Shot]], frames: list[list[int]]
) -> None:
    """Copies pictures and masks as they are."""
    copies: dict[Path, Path] = {}
    check_room(work, sum(_size(file) for file in _files(cameras)))
    with shown("copying", sum(map(len, cameras))) as advance:
        for place, shots, numbers in zip(places, cameras, frames, strict=True):
            for shot, frame in zip(shots, numbers, strict=True):
                for kind, file in (("images", shot.file), ("masks", shot.mask)):
                    if file is not None:
                        suffix = file.suffix.lower()
                        target = work / kind / place.lens.name / f"{frame:06d}{suffix}"
                        target.parent.mkdir(parents=True, exist_ok=True)
                        _place(file, target, copies)
                advance()


def _files(cameras: list[list[Shot]]) -> set[Path]:
    """Pictures and masks, each once."""
    shots = [shot for row in cameras for shot in row]
    return {shot.file for shot in shots} | {shot.mask for shot in shots if shot.mask is not None}


def _size(file: Path) -> int:
    """Bytes of a file, which its copy has, too.

    Raises:
        CaptureError: If it has a hole, in which a disk keeps nothing; no picture has any.
    """
    with file.open("rb") as opened:
        size = os.fstat(opened.fileno()).st_size
        if size and os.lseek(opened.fileno(), 0, os.SEEK_HOLE) < size:
            raise CaptureError(f"{file} has holes, which no picture has.")
    return size


def _place(file: Path, target: Path, copies: dict[Path, Path]) -> None:
    """Copies a file, once: masks may be of many pictures, which share one copy."""
    if file in copies:
        with suppress(OSError):  # not all disks have a second name for a file
            os.link(copies[file], target)
            return
    copies[file] = target
    shutil.copyfile(file, target)
