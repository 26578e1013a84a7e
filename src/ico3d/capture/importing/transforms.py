"""Reads `transforms.json` of nerfstudio and instant-ngp (nerfstudio's "Data conventions")."""

from collections import ChainMap
from collections.abc import Mapping
from math import tan
from pathlib import Path

import numpy as np

from ico3d.capture.decoding import size_of
from ico3d.capture.importing.foreign import Foreign, Shot, fitted, inside, take_once
from ico3d.capture.lens import Lens
from ico3d.capture.multiview.description import matrix, number, read_json
from ico3d.capture.poses import rigid
from ico3d.errors import CaptureError

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
STRAIGHT_OR_RADIAL = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL", "RADIAL")
FARTHEST = 1e6


def read_transforms(file: Path) -> Foreign:
    """Reads cameras and pictures of a file; each frame may have intrinsics of its own.

    Args:
        file: The file; the pictures' paths are relative to its folder.

    Raises:
        CaptureError: If the file is damaged, a picture is missing, or a lens model is not
            supported.
    """
    content = read_json(file)
    frames = content.get("frames")
    if not isinstance(frames, list) or not frames:
        raise CaptureError(f"{file} lists no frames.")
    taken = set[Path]()
    shots = [_shot(file, content, index, frame, taken) for index, frame in enumerate(frames)]
    if len({shot.time is None for shot in shots}) > 1:
        raise CaptureError(f"{file}: some frames have a time and others none.")
    return Foreign("transforms.json", shots, None, axes_mean_up=True)


def _shot(file: Path, content: dict, index: int, frame: object, taken: set[Path]) -> Shot:
    """One entry of `frames` as a picture with its pose and lens."""
    where = f"{file}: frame {index}"
    if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str):
        raise CaptureError(f"{where} has no file_path.")
    picture = inside(file.parent, frame["file_path"], where)
    take_once(picture, taken, str(file))
    merged = ChainMap(frame, content)  # a copy for each frame would take the square of the file
    pose = rigid(_pose(frame, where), where) @ OPENGL_FROM_OPENCV
    named = frame.get("mask_path")
    mask = inside(file.parent, named, where) if isinstance(named, str) else None
    time = number(frame, "time", where, -1e9, 1e9) if frame.get("time") is not None else None
    return Shot(picture, fitted(_lens(merged, picture, where), picture), pose, time, mask)


def _pose(frame: dict, where: str) -> np.ndarray:
    """`transform_matrix`: camera to world, of which the last row may lack."""
    rows = frame.get("transform_matrix")
    whole = [*rows, [0, 0, 0, 1]] if isinstance(rows, list) and len(rows) == 3 else rows
    return matrix({"transform_matrix": whole}, "transform_matrix", where, 4)


def _lens(merged: Mapping, picture: Path, where: str) -> Lens:
    """The lens of a frame."""
    model = merged.get("camera_model", "OPENCV")
    if model not in STRAIGHT_OR_RADIAL or merged.get("is_fisheye"):
        raise CaptureError(
            f"{where}: lenses of the kind {model if model != 'OPENCV' else 'fisheye'} are not "
            "read here: straighten the pictures first."
        )

    def get(key: str, otherwise: float, least: float = -FARTHEST) -> float:
        given = merged.get(key) is not None
        return number(merged, key, where, least, FARTHEST) if given else otherwise

    width, height = size_of(picture, str(picture))
    width, height = get("w", width, 1), get("h", height, 1)
    focal_x = get("fl_x", 0.0, 1e-3) or _focal(merged, "camera_angle_x", width, where)
    focal_y = get("fl_y", focal_x, 1e-3)
    if merged.get("fl_y") is None and merged.get("camera_angle_y") is not None:
        focal_y = _focal(merged, "camera_angle_y", height, where)
    center = get("cx", width / 2), get("cy", height / 2)
    intrinsics = np.array([[focal_x, 0, center[0]], [0, focal_y, center[1]], [0, 0, 1]])
    bent = tuple(get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3"))
    return Lens(picture.stem, int(width), int(height), intrinsics, bent)


def _focal(merged: Mapping, key: str, size: float, where: str) -> float:
    """Focal length in pixels from the angle that the picture spans."""
    return 0.5 * size / tan(0.5 * number(merged, key, where, 1e-4, 3.14))
