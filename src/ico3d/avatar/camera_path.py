"""Camera paths of films: an orbit around the person, or a path through key cameras."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.avatar.render_bundle import visitor_camera
from ico3d.body.training.novel_views import se3_exp, se3_log
from ico3d.bundle.limits import MAX_CAMERA_LENGTH
from ico3d.bundle.manifest import CameraInfo
from ico3d.capture.surface.hull import focus
from ico3d.common.camera import Camera
from ico3d.common.files import json_of
from ico3d.errors import CaptureError, SettingsError

AIR = 1.15
"""Size of an orbit's picture as a multiple of the person's size in it."""
AWAY = 3.5
"""Distance of the camera from the person's middle where no capture gives an orbit.

In halves of the longest side of the person's bounding box.
"""
ELEVATION = np.radians(8)
"""Elevation of the camera above the person's middle, radians, where no capture gives an orbit."""
OPPOSITE = np.radians(179)
"""Largest rotation between successive key cameras, radians: at π the shortest way is ambiguous."""
MOST_KEYS = 1000
"""Key cameras of a path."""
FIELD_OF_VIEW = 40.0
"""Vertical field of view of key cameras that name none, degrees."""


@dataclass(frozen=True)
class Ring:
    """The circle of an orbit.

    Attributes:
        middle: (3,) point that the camera looks at, metres.
        up: (3,) axis of the circle, of length 1.
        start: (3,) first position of the camera, metres.
    """

    middle: np.ndarray
    up: np.ndarray
    start: np.ndarray


def ring_around(points: np.ndarray) -> Ring:
    """An orbit that begins in front of a person who looks along +z in a world with y up.

    Args:
        points: (P, 3) positions of the person's Gaussians in the world.
    """
    low, high = points.min(0), points.max(0)
    middle, away = (low + high) / 2, AWAY * float((high - low).max()) / 2
    toward = np.array([0.0, np.sin(ELEVATION), np.cos(ELEVATION)])
    return Ring(middle, np.array([0.0, 1.0, 0.0]), middle + away * toward)


def ring_of(cameras: Sequence[Camera], points: np.ndarray) -> Ring:
    """An orbit at the mean distance and height of recording cameras.

    It begins at the azimuth of the first camera.

    Args:
        cameras: Cameras that look at one place from different sides.
        points: (P, 3) positions of the person's Gaussians, for the height of the orbit's middle.

    Raises:
        CaptureError: If the cameras do not stand around anything.
    """
    looked_at = focus(cameras)
    up = -np.mean([camera.camera_to_world[:3, 1] for camera in cameras], axis=0)
    if looked_at is None or np.linalg.norm(up) < 0.1:
        raise CaptureError(
            "the capture's cameras do not stand around the person: leave --capture out."
        )
    up /= np.linalg.norm(up)
    heights = points @ up
    middle = looked_at + up * ((heights.min() + heights.max()) / 2 - looked_at @ up)
    offsets = np.stack([camera.camera_to_world[:3, 3] for camera in cameras]) - middle  # (C, 3)
    level = offsets - (offsets @ up)[:, None] * up  # (C, 3)
    radius, height = np.linalg.norm(level, axis=1).mean(), (offsets @ up).mean()
    start = middle + up * height + level[0] / np.linalg.norm(level[0]) * radius
    return Ring(middle, up, start)


def orbit(ring: Ring, points: np.ndarray, count: int, width: int, height: int) -> list[Camera]:
    """Cameras on one turn of an orbit, with the field of view that holds the person throughout.

    Args:
        ring: The orbit.
        points: (P, 3) positions of the person's Gaussians in the world.
        count: Number of cameras; one step after the last would be the first again.
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.
    """
    fov = _enclosing_fov(ring, points, width / height)
    arm = ring.start - ring.middle
    cameras = []
    for turned in 2 * np.pi * np.arange(count) / count:
        across = np.cross(ring.up, arm)
        along = (arm @ ring.up) * ring.up
        eye = ring.middle + along + np.cos(turned) * (arm - along) + np.sin(turned) * across
        cameras.append(_camera(eye, ring.middle, ring.up, fov, width, height))
    return cameras


def _enclosing_fov(ring: Ring, points: np.ndarray, aspect: float) -> float:
    """Vertical field of view, degrees, that holds a person (P, 3) through a whole orbit."""
    offsets = points - ring.middle
    heights = np.abs(offsets @ ring.up)  # (P,)
    around = np.linalg.norm(offsets - (offsets @ ring.up)[:, None] * ring.up, axis=1)  # (P,)
    away = float(np.linalg.norm(ring.start - ring.middle))
    nearest = np.maximum(away - around, 0.1 * away)
    slope = max((heights / nearest).max(), (around / nearest).max() / aspect)
    return float(2 * np.degrees(np.arctan(AIR * slope)))


def _camera(eye, target, up, fov: float, width: int, height: int) -> Camera:
    return visitor_camera(CameraInfo(tuple(eye), tuple(target), tuple(up), fov), width, height)


def read_key_cameras(file: Path, width: int, height: int) -> list[Camera]:
    """Reads `{"cameras": [{"eye": [x, y, z], "target": [x, y, z], "up": …, "fov_y": …}, …]}`.

    Positions are metres in the world of the model. `up` is +y by default, `fov_y` (the vertical
    field of view) 40 degrees.

    Args:
        file: The JSON file.
        width: Width of the picture in pixels.
        height: Height of the picture in pixels.

    Raises:
        SettingsError: If the file cannot be read, or a camera in it makes no sense.
    """
    try:
        entries = json_of(file)["cameras"]
        if len(entries) > MOST_KEYS:
            raise ValueError(f"it has {len(entries)} cameras, at most {MOST_KEYS} are read")
        cameras = [_key_camera(entry, width, height) for entry in entries]
    except (OSError, ValueError, LookupError, TypeError, OverflowError) as error:
        raise SettingsError(
            f'{file} is no camera path ({error}): it should look like {{"cameras": '
            '[{"eye": [0, 1, 3], "target": [0, 1, 0]}, …]}.'
        ) from error
    if not cameras:
        raise SettingsError(f"{file} names no camera.")
    return cameras


def _key_camera(entry: dict, width: int, height: int) -> Camera:
    """The camera of one entry in a file of key cameras.

    Raises:
        KeyError: If `eye` or `target` is missing.
        TypeError: If a value has the wrong type.
        ValueError: If a key is unknown, or a value makes no sense.
    """
    unknown = set(entry) - {"eye", "target", "up", "fov_y"}
    if unknown:
        raise ValueError(f"unknown {sorted(unknown)}")
    places = [np.array(entry[name], np.float64) for name in ("eye", "target")]
    places.append(np.array(entry.get("up", (0.0, 1.0, 0.0)), np.float64))
    fov = float(entry.get("fov_y", FIELD_OF_VIEW))
    # Written so that NaN, too, is not within.
    if not all(p.shape == (3,) and (abs(p) <= MAX_CAMERA_LENGTH).all() for p in places):
        most = f"of at most {MAX_CAMERA_LENGTH:g} m"
        raise ValueError(f"eye, target and up have three numbers each, {most}")
    if not 1 <= fov <= 170:
        raise ValueError("fov_y lies between 1 and 170 degrees")
    eye, target, up = places
    if np.linalg.norm(np.cross(target - eye, up)) < 1e-9:
        raise ValueError("a camera needs a direction, which up must not be")
    return _camera(eye, target, up, fov, width, height)


def through(keys: Sequence[Camera], count: int) -> list[Camera]:
    """Cameras on a path from the first key camera to the last, as long for each pair of keys.

    From a key pose P to the next, Q, poses follow the geodesic P·exp(s·log(P⁻¹·Q)) of SE(3), and
    focal lengths are interpolated geometrically.

    Args:
        keys: Key cameras of one picture size.
        count: Number of cameras to return.

    Raises:
        SettingsError: If successive key cameras are turned by half a turn (`OPPOSITE`).
    """
    if len(keys) == 1:
        return list(keys) * count
    poses = np.stack([key.camera_to_world for key in keys])  # (K, 4, 4)
    between = np.linalg.inv(poses[:-1]) @ poses[1:]  # (K - 1, 4, 4)
    cosines = (np.trace(between[:, :3, :3], axis1=1, axis2=2) - 1) / 2  # (K - 1,)
    for index in np.flatnonzero(cosines < np.cos(OPPOSITE)):
        raise SettingsError(
            f"key cameras {index} and {index + 1} of the path are turned by half a turn: "
            "put another between them."
        )
    twists = se3_log(between)  # (K - 1, 6)
    cameras = []
    for place in np.linspace(0, len(keys) - 1, count):
        index = min(int(place), len(keys) - 2)
        pose = poses[index] @ se3_exp((place - index) * twists[index])
        cameras.append(_mixed(keys[index], keys[index + 1], place - index, pose))
    return cameras


def _mixed(before: Camera, after: Camera, part: float, pose: np.ndarray) -> Camera:
    """A camera with focal lengths between those of two cameras.

    Args:
        before: Camera for part 0; size and principal point are taken from it.
        after: Camera for part 1.
        part: From 0 to 1.
        pose: (4, 4) `camera_to_world` of the result.
    """
    intrinsics = before.intrinsics.copy()
    for axis in (0, 1):
        ratio = after.intrinsics[axis, axis] / before.intrinsics[axis, axis]
        intrinsics[axis, axis] *= ratio**part
    return Camera(before.width, before.height, intrinsics, np.linalg.inv(pose), "film")
