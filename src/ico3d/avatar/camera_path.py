"""Where the camera of a film goes: around the person, or from key camera to key camera."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.avatar.render_bundle import visitor_camera
from ico3d.body.training.novel_views import se3_exp, se3_log
from ico3d.bundle.manifest import CameraInfo
from ico3d.capture.surface.hull import focus
from ico3d.common.camera import Camera
from ico3d.errors import CaptureError, SettingsError

AIR = 1.15
"""How much larger the picture is than the person in it."""
AWAY = 3.5
"""Distance of an orbit, in halves of the person's larger side, where no capture says better."""
ELEVATION = np.radians(8)
"""Angle of an orbit above the person's middle, where no capture says better."""
OPPOSITE = np.radians(179)
"""Turn between two key cameras from which on there is no shortest way."""
FIELD_OF_VIEW = 40.0


@dataclass(frozen=True)
class Ring:
    """The circle of an orbit.

    Attributes:
        middle: (3,) what the camera looks at.
        up: (3,) unit vector, the axis.
        start: (3,) where the camera begins.
    """

    middle: np.ndarray
    up: np.ndarray
    start: np.ndarray


def ring_around(points: np.ndarray) -> Ring:
    """A circle around a person (P, 3) who stands in a world with y up and looks along z."""
    low, high = points.min(0), points.max(0)
    middle, away = (low + high) / 2, AWAY * float((high - low).max()) / 2
    toward = np.array([0.0, np.sin(ELEVATION), np.cos(ELEVATION)])
    return Ring(middle, np.array([0.0, 1.0, 0.0]), middle + away * toward)


def ring_of(cameras: Sequence[Camera], points: np.ndarray) -> Ring:
    """The circle nearest to recording cameras; it begins at the azimuth of the first.

    Args:
        cameras: They look at one place from different sides.
        points: (P, 3) the person, who decides how high the middle is.

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
    """Cameras on one turn of a circle, as far zoomed in as shows the whole person from all sides.

    Args:
        ring: The circle.
        points: (P, 3) the person.
        count: How many cameras; the turn closes after the last.
        width: Width of the picture in pixels.
        height: Its height.
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
    """Vertical field of view, degrees, in which a person stays through the whole turn."""
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

    Metres in the world of the model; `up` is y where it is left out, `fov_y` 40 degrees.

    Args:
        file: The JSON file.
        width: Width of the picture in pixels.
        height: Its height.

    Raises:
        SettingsError: If it cannot be read, or makes no sense.
    """
    try:
        entries = json.loads(file.read_text())["cameras"]
        cameras = [_key_camera(entry, width, height) for entry in entries]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SettingsError(
            f'{file} is no camera path ({error}): it should look like {{"cameras": '
            '[{"eye": [0, 1, 3], "target": [0, 1, 0]}, …]}.'
        ) from error
    if not cameras:
        raise SettingsError(f"{file} names no camera.")
    return cameras


def _key_camera(entry: dict, width: int, height: int) -> Camera:
    """One entry of a file.

    Raises:
        ValueError: If a value makes no sense.
    """
    unknown = set(entry) - {"eye", "target", "up", "fov_y"}
    if unknown:
        raise ValueError(f"unknown {sorted(unknown)}")
    places = [np.array(entry[name], np.float64) for name in ("eye", "target")]
    places.append(np.array(entry.get("up", (0.0, 1.0, 0.0)), np.float64))
    fov = float(entry.get("fov_y", FIELD_OF_VIEW))
    if any(place.shape != (3,) or not np.isfinite(place).all() for place in places):
        raise ValueError("eye, target and up have three numbers each")
    if not 1 <= fov <= 170:
        raise ValueError("fov_y lies between 1 and 170 degrees")
    eye, target, up = places
    if np.linalg.norm(np.cross(target - eye, up)) < 1e-9:
        raise ValueError("a camera needs a direction, which up must not be")
    return _camera(eye, target, up, fov, width, height)


def through(keys: Sequence[Camera], count: int) -> list[Camera]:
    """Cameras from the first key camera to the last, equally long from key to key.

    Poses run along geodesics of SE(3), P·exp(s·log(P⁻¹·Q)), focal lengths geometrically.

    Args:
        keys: Key cameras of one picture size.
        count: How many cameras.

    Raises:
        SettingsError: If one key camera looks the opposite way of the one before.
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
    """A camera at a pose whose focal length lies between those of two others."""
    intrinsics = before.intrinsics.copy()
    for axis in (0, 1):
        ratio = after.intrinsics[axis, axis] / before.intrinsics[axis, axis]
        intrinsics[axis, axis] *= ratio**part
    return Camera(before.width, before.height, intrinsics, np.linalg.inv(pose), "film")
