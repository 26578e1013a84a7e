"""Reads COLMAP's sparse models, text and binary (COLMAP's documentation, "Output Format")."""

import os
import struct
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ico3d.capture.importing.foreign import Foreign, Shot, fitted, inside, take_once
from ico3d.capture.lens import Lens
from ico3d.common.files import MOST_BYTES, check_regular, read_small
from ico3d.common.unpacking.memory import lacks_room
from ico3d.errors import CaptureError

MODELS = {
    0: ("SIMPLE_PINHOLE", 3),
    1: ("PINHOLE", 4),
    2: ("SIMPLE_RADIAL", 4),
    3: ("RADIAL", 5),
    4: ("OPENCV", 8),
    6: ("FULL_OPENCV", 12),
}
"""Supported camera models: number, name and number of parameters."""
MOST_PARAMETERS = max(count for _, count in MODELS.values())
ONE_FOCAL = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
MOST_POINTS = 20_000_000
"""Points of a model that are read; models of large places have some millions."""
MOST_CAMERAS = 100_000
"""Cameras of a model that are read: 400 bytes of memory each."""
LONGEST_LINE = 1 << 24
"""Letters of a line, of which all points of a picture take one."""
Pose = tuple[str, int, np.ndarray]
"""Picture's file name, camera's id, and (7,) quaternion wxyz and translation, world to camera."""


def is_model(folder: Path) -> bool:
    """Whether a folder holds a sparse model."""
    return any(
        os.path.isfile(folder / f"cameras.{kind}") and os.path.isfile(folder / f"images.{kind}")
        for kind in ("bin", "txt")
    )


def read_colmap(model: Path, images: Path) -> Foreign:
    """Reads a sparse model; each picture becomes a separate camera.

    Args:
        model: Folder with cameras, images and points3D, binary or text.
        images: Folder to which the pictures' names are relative.

    Raises:
        CaptureError: If a file is missing or damaged, or a camera model is not supported.
    """
    binary = os.path.isfile(model / "cameras.bin")
    suffix = "bin" if binary else "txt"
    cameras, poses, points = (model / f"{n}.{suffix}" for n in ("cameras", "images", "points3D"))
    try:
        lenses = _binary_cameras(cameras) if binary else _text_cameras(cameras)
        taken = set[Path]()
        shots = [
            _shot(images, poses, lenses, pose, taken)
            for pose in (_binary_poses(poses) if binary else _text_poses(poses))
        ]
        cloud = None
        if os.path.isfile(points):
            cloud = _binary_points(points) if binary else _text_points(points)
    except (ValueError, IndexError, OverflowError, struct.error, OSError) as error:
        raise CaptureError(f"{model}: the COLMAP model is damaged or cut off.") from error
    if not shots:
        raise CaptureError(f"{poses} lists no pictures.")
    if cloud is not None and not (len(cloud) and np.isfinite(cloud).all()):
        cloud = None
    return Foreign("COLMAP", shots, cloud, axes_mean_up=False)


def _shot(images: Path, poses: Path, lenses: dict[int, Lens], pose: Pose, taken: set[Path]) -> Shot:
    """A picture of the model with its pose and lens."""
    name, camera, numbers = pose
    if camera not in lenses:
        raise CaptureError(f"{poses}: {name} names camera {camera}, which does not exist.")
    file = inside(images, name, str(poses))
    take_once(file, taken, str(poses))
    return Shot(file, fitted(lenses[camera], file), _camera_to_world(numbers, f"{poses}: {name}"))


def _lens(file: Path, number: int, name: str, width: int, height: int, values: list[float]) -> Lens:
    """A lens from COLMAP's parameters; its pixel centres are at +0.5, as ours."""
    counts = dict(MODELS.values())
    if name not in counts:
        raise CaptureError(
            f"{file}: camera {number} is of the model {name}; "
            f"read are {', '.join(counts)}: run colmap image_undistorter first."
        )
    if len(values) != counts[name]:
        raise CaptureError(f"{file}: camera {number} needs {counts[name]} parameters.")
    focal_x, *rest = values
    focal_y, x, y, *bent = [focal_x, *rest] if name in ONE_FOCAL else rest
    bent = [*bent, *(0.0,) * (4 - len(bent))] if bent else []
    matrix = np.array([[focal_x, 0, x], [0, focal_y, y], [0, 0, 1.0]])
    return Lens(str(number), width, height, matrix, tuple(bent))


def _camera_to_world(numbers: np.ndarray, what: str) -> np.ndarray:
    """(4, 4) from the quaternion and translation of world to camera."""
    length = np.linalg.norm(numbers[:4])
    if not np.isfinite(numbers).all() or not 0.5 < length < 2:
        raise CaptureError(f"{what} has a damaged pose.")
    w, x, y, z = numbers[:4] / length
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.T
    matrix[:3, 3] = -rotation.T @ numbers[4:]
    return matrix


def _lines(file: Path) -> Iterator[str]:
    """Lines of a text file without comments; empty ones count."""
    check_regular(file)
    with file.open(encoding="utf-8") as opened:
        while line := opened.readline(LONGEST_LINE):
            if len(line) == LONGEST_LINE:
                raise ValueError(f"{file} has a line of more than {LONGEST_LINE} letters")
            if not line.startswith("#"):
                yield line


def _words(file: Path, most: int) -> Iterator[list[str]]:
    """Words of the lines that have any, of which there must be four; the last has what is left."""
    for line in _lines(file):
        words = line.split(maxsplit=most - 1)
        if 0 < len(words) < 4:
            raise ValueError(f"{file} has a line of {len(words)} words")
        if words:
            yield words


def _check_count(file: Path, count: int, most: int, what: str) -> None:
    if count > most:
        raise CaptureError(f"{file} states {count} {what}: at most {most} are read.")


def _text_cameras(file: Path) -> dict[int, Lens]:
    """cameras.txt: number, model, width, height, parameters."""
    lenses = {}
    for words in _words(file, MOST_PARAMETERS + 5):
        _check_count(file, len(lenses) + 1, MOST_CAMERAS, "cameras")
        number, name, width, height = int(words[0]), words[1], int(words[2]), int(words[3])
        lenses[number] = _lens(file, number, name, width, height, list(map(float, words[4:])))
    return lenses


def _text_poses(file: Path) -> Iterator[Pose]:
    """images.txt: number, quaternion, translation, camera, name; every second line has points."""
    lines = _lines(file)
    for line in lines:
        if not line.strip():
            continue
        words = line.strip().split(maxsplit=9)
        yield words[9], int(words[8]), np.array(words[1:8], np.float64)
        next(lines, None)


def _text_points(file: Path) -> np.ndarray:
    """points3D.txt: number, position, …; (P, 3)."""
    numbers = array("f")
    for words in _words(file, 5):
        numbers.extend(map(float, words[1:4]))
        _check_count(file, len(numbers) // 3, MOST_POINTS, "points")
    return np.array(numbers, np.float32).reshape(-1, 3)


class _Bytes:
    """A binary file read from front to back."""

    def __init__(self, file: Path):
        if lacking := lacks_room(file, 3):
            raise CaptureError(f"{file} {lacking}.")
        self._data, self._at = read_small(file, most=MOST_BYTES), 0

    def take(self, layout: str) -> tuple:
        """The next numbers, little-endian, by a layout of the module struct."""
        values = struct.unpack_from(f"<{layout}", self._data, self._at)
        self._at += struct.calcsize(f"<{layout}")
        return values

    def text(self) -> str:
        """The next characters up to a zero."""
        end = self._data.index(b"\0", self._at)
        text = self._data[self._at : end].decode()
        self._at = end + 1
        return text

    def skip(self, count: int, size: int) -> None:
        """Passes over records."""
        self._at += count * size
        if self._at > len(self._data):
            raise ValueError("cut off")


def _binary_cameras(file: Path) -> dict[int, Lens]:
    """cameras.bin."""
    data, lenses = _Bytes(file), {}
    count = data.take("Q")[0]
    _check_count(file, count, MOST_CAMERAS, "cameras")
    for _ in range(count):
        number, model, width, height = data.take("iiQQ")
        name, parameters = MODELS.get(model, (f"number {model}", 0))
        values = list(data.take(f"{parameters}d"))
        lenses[number] = _lens(file, number, name, width, height, values)
    return lenses


def _binary_poses(file: Path) -> Iterator[Pose]:
    """images.bin."""
    data = _Bytes(file)
    for _ in range(data.take("Q")[0]):
        _, *numbers, camera = data.take("I7dI")
        yield data.text(), camera, np.array(numbers)
        data.skip(data.take("Q")[0], 24)


def _binary_points(file: Path) -> np.ndarray:
    """points3D.bin, (P, 3)."""
    data = _Bytes(file)
    count = data.take("Q")[0]
    _check_count(file, count, MOST_POINTS, "points")
    points = np.empty((count, 3), np.float32)
    for row in points:
        row[:] = data.take("Q3d3Bd")[1:4]
        data.skip(data.take("Q")[0], 8)
    return points
