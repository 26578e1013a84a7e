"""The file `cameras.json` of a multiview folder (docs/captures/multiview.md)."""

import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.capture.lens import Lens
from ico3d.capture.poses import rigid
from ico3d.common.files import json_of, write_atomic
from ico3d.common.people.stated import NOT_STATED
from ico3d.errors import CaptureError

NAME = "cameras.json"
FORMAT, VERSION = "ico3d-multiview", 1
MOST_FRAMES = 10_000_000
SUBJECTS = ("body", "head")
SAFE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
"""Allowed camera names, which are also names of folders and files."""


@dataclass(frozen=True)
class Place:
    """A camera: lens, name and pose.

    Attributes:
        lens: Lens of the recorded pictures; also holds the camera's name.
        world_to_camera: (4, 4) rigid pose, OpenCV axes, metres.
    """

    lens: Lens
    world_to_camera: np.ndarray


@dataclass(frozen=True)
class Description:
    """The contents of `cameras.json`.

    Attributes:
        fps: Frames per second.
        num_frames: Number of frames of every camera.
        places: The cameras.
        sources: Data from which the recording was made.
        consent: What the person agreed to, and how.
        licence: Licence of the recording.
        shows: What fills the pictures: "body", or "head" (with or without shoulders).
        likeness: Who the person is.
    """

    fps: float
    num_frames: int
    places: tuple[Place, ...]
    sources: tuple[str, ...] = ()
    consent: str = NOT_STATED
    licence: str = NOT_STATED
    shows: str = "body"
    likeness: str = NOT_STATED

    def write(self, folder: Path) -> None:
        """Writes `cameras.json` into a folder."""
        content = {
            "format": FORMAT,
            "version": VERSION,
            "shows": self.shows,
            "fps": self.fps,
            "num_frames": self.num_frames,
            "sources": list(self.sources),
            "likeness": self.likeness,
            "consent": self.consent,
            "licence": self.licence,
            "cameras": [_entry(place) for place in self.places],
        }
        write_atomic(folder / NAME, (json.dumps(content, indent=1) + "\n").encode())


def read_description(folder: Path) -> Description:
    """Reads `cameras.json` from a folder.

    Raises:
        CaptureError: If the file is missing or damaged, or a value is impossible.
    """
    file = folder / NAME
    content = read_json(file)
    if content.get("format") != FORMAT:
        raise CaptureError(f"{file} does not describe a multiview folder (format '{FORMAT}').")
    if content.get("version") != VERSION:
        raise CaptureError(f"{file} has version {content.get('version')}; this reads {VERSION}.")
    entries = content.get("cameras")
    if not isinstance(entries, list) or not entries:
        raise CaptureError(f"{file} lists no cameras.")
    places = tuple(_place(file, index, entry) for index, entry in enumerate(entries))
    names = Counter(place.lens.name.lower() for place in places)
    doubled = next((name for name, count in names.items() if count > 1), None)
    if doubled is not None:
        raise CaptureError(f"{file}: two cameras are called {doubled}.")
    shows = content.get("shows", "body")
    if shows not in SUBJECTS:
        raise CaptureError(f'{file}: shows must be "body" or "head".')
    sources = content.get("sources", [])
    return Description(
        float(number(content, "fps", f"{file}", 1e-3, 1e5)),
        int(number(content, "num_frames", f"{file}", 1, MOST_FRAMES)),
        places,
        tuple(map(str, sources)) if isinstance(sources, list) else (),
        str(content.get("consent", NOT_STATED)),
        str(content.get("licence", NOT_STATED)),
        shows,
        str(content.get("likeness", NOT_STATED)),
    )


def read_json(file: Path) -> dict:
    """Reads a file that must hold one JSON object.

    Raises:
        CaptureError: If the file is missing or damaged.
    """
    try:
        content = json_of(file)
    except FileNotFoundError as error:
        raise CaptureError(f"{file} is missing.") from error
    except (OSError, ValueError) as error:
        raise CaptureError(f"{file} is damaged: it is no JSON ({error}).") from error
    if not isinstance(content, dict):
        raise CaptureError(f"{file} must hold a JSON object.")
    return content


def number(entry: Mapping, key: str, where: str, least: float, most: float) -> float:
    """A number in a JSON object.

    Args:
        entry: The object.
        key: Key of the number.
        where: Name of the object, for errors.
        least: Smallest allowed value.
        most: Largest allowed value.

    Raises:
        CaptureError: If the value is missing, no number, or outside of the limits.
    """
    value: Any = entry.get(key)
    # NaN is in no range; Python's whole numbers know no bounds, so they are compared as they are.
    plain = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not plain or not least <= value <= most:
        raise CaptureError(f"{where}: {key} must be a number from {least:g} to {most:g}.")
    return float(value)


def matrix(entry: dict, key: str, where: str, size: int) -> np.ndarray:
    """A square matrix (size, size) in a JSON object; arguments as for `number`.

    Raises:
        CaptureError: If the value is missing or no finite matrix of this size.
    """
    try:
        values = np.array(entry.get(key), np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.empty(0)
    if values.shape != (size, size) or not np.isfinite(values).all():
        raise CaptureError(f"{where}: {key} must be a finite {size}x{size} matrix.")
    return values


def _entry(place: Place) -> dict:
    """A camera as JSON."""
    lens = place.lens
    entry = {
        "name": lens.name,
        "width": lens.width,
        "height": lens.height,
        "intrinsics": lens.intrinsics.tolist(),
        "world_to_camera": place.world_to_camera.tolist(),
    }
    return {**entry, "distortion": list(lens.distortion)} if lens.bends else entry


def _place(file: Path, index: int, entry: object) -> Place:
    """A camera from JSON."""
    where = f"{file}: camera {index}"
    name = entry.get("name") if isinstance(entry, dict) else None
    if not isinstance(entry, dict) or not isinstance(name, str) or not SAFE_NAME.fullmatch(name):
        raise CaptureError(f"{where} needs a name of letters, digits, '_', '-' and '.'.")
    where = f"{file}: camera {name}"
    width, height = (int(number(entry, key, where, 1, 100_000)) for key in ("width", "height"))
    intrinsics = matrix(entry, "intrinsics", where, 3)
    lens = Lens(name, width, height, intrinsics, _distortion(entry, where))
    return Place(lens, rigid(matrix(entry, "world_to_camera", where, 4), where))


def _distortion(entry: dict, where: str) -> tuple[float, ...]:
    """The coefficients of a camera; none where it has none."""
    values = entry.get("distortion", [])
    try:
        return tuple(float(value) for value in values)
    except (TypeError, ValueError, OverflowError) as error:
        raise CaptureError(f"{where}: distortion must be a list of numbers.") from error
