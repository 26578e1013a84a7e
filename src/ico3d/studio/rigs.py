"""Arrangements of cameras: an arc in front of a head, or rings all around a body."""

from dataclasses import dataclass

import numpy as np

from ico3d.common.camera import Camera, look_at
from ico3d.studio.person.subject import Subject

DISTANCE = 1.35
"""Distance of the cameras from the head, metres."""
WIDEST_AZIMUTH = 60.0


@dataclass(frozen=True)
class Framing:
    """What the pictures of a camera rig show.

    Attributes:
        height: Height of the visible field at the head, metres.
        aim: Height of the point that cameras look at, metres relative to the canonical origin at
            rest.
        aspect: Width of the pictures divided by their height.
    """

    height: float
    aim: float
    aspect: float = 1.0


ARCS = {"head": Framing(0.31, -0.02), "bust": Framing(0.46, -0.045)}
"""The head fills three quarters of a `head` picture and half of a `bust` picture."""

BODY = Framing(2.36, 1.05, 0.62)
"""A person from the floor to above raised hands; `aim` is a height above the floor here."""
UPPER_BODY = Framing(0.9, 1.31, 1.2)
"""From the hips to above the head, hands that wave included; `aim` is a height above the floor."""
UPPER_ARC = 100.0
"""Widest azimuth of cameras before an upper body, degrees to either side."""
BODY_DISTANCE = 2.8
RINGS = (-7.0, 5.0, 17.0)
"""Elevation angles of the rings of cameras around a body, degrees."""
RIGS = (*ARCS, "body")


def cameras_of(
    subject: Subject, rig: str, count: int, size: int, near: int = 0
) -> tuple[Camera, ...]:
    """The cameras of a rig.

    Args:
        subject: The person; the rest pose decides where an arc is placed.
        rig: One of `RIGS`.
        count: Number of cameras.
        size: Height of the pictures in pixels; pictures of heads are square.
        near: How many of the cameras of a whole person, the last ones, show the upper body alone.
    """
    if rig == "body":
        return camera_rings(count - near, size) + cameras_before(near, size, count - near)
    return camera_arc(subject, rig, count, size)


def camera_rings(count: int, height: int) -> tuple[Camera, ...]:
    """Cameras all around a body at evenly spaced azimuths; neighbours are on different rings.

    Args:
        count: Number of cameras.
        height: Height of the pictures in pixels.
    """
    return _on_rings(BODY, 360.0 * np.arange(count) / count, height)


def cameras_before(count: int, height: int, first: int) -> tuple[Camera, ...]:
    """Cameras on an arc before an upper body, which they show as large as their pictures allow.

    Args:
        count: Number of cameras.
        height: Height of the pictures in pixels.
        first: Number that the first of these cameras has as its name.
    """
    azimuths = UPPER_ARC * (2 * (np.arange(count) + 0.5) / max(count, 1) - 1)
    return _on_rings(UPPER_BODY, azimuths, height, first)


def _on_rings(
    framing: Framing, azimuths: np.ndarray, height: int, first: int = 0
) -> tuple[Camera, ...]:
    """Cameras around a standing person at azimuths (C,) in degrees, on one ring after the other."""
    width = 2 * round(framing.aspect * height / 2)
    focal = height * BODY_DISTANCE / framing.height
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    target = np.array([0.0, framing.aim, 0.0])
    cameras = []
    for index, azimuth in enumerate(azimuths):
        towards = _towards(float(azimuth), RINGS[(index + 1) % len(RINGS)])
        pose = look_at(target + BODY_DISTANCE * towards, target)
        cameras.append(Camera(width, height, intrinsics, pose, str(first + index)))
    return tuple(cameras)


def camera_arc(subject: Subject, rig: str, count: int, size: int) -> tuple[Camera, ...]:
    """Cameras on a frontal arc around the head; the first one looks straight at the face.

    Args:
        subject: The person; the rest pose decides where the arc is placed.
        rig: One of `ARCS`.
        count: Number of cameras.
        size: Width and height of the pictures in pixels.
    """
    framing = ARCS[rig]
    target = subject.head_in_world + np.array([0.0, framing.aim, 0.0])
    focal = size * DISTANCE / framing.height
    intrinsics = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]])
    cameras = []
    for index in range(count):
        towards = _towards(*_direction(index, count))
        pose = look_at(target + DISTANCE * towards, target)
        cameras.append(Camera(size, size, intrinsics, pose, str(index)))
    return tuple(cameras)


def _towards(azimuth: float, elevation: float) -> np.ndarray:
    """(3,) unit vector from degrees; 0, 0 is where the face looks."""
    azimuth, elevation = np.radians((azimuth, elevation))
    return np.array(
        [
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
            np.cos(azimuth) * np.cos(elevation),
        ]
    )


def _direction(index: int, count: int) -> tuple[float, float]:
    """Azimuth and elevation in degrees: the front, then wider and wider, side by side."""
    if index == 0:
        return 0.0, 0.0
    ring, rings = (index + 1) // 2, count // 2
    side = 1.0 if index % 2 else -1.0
    return side * WIDEST_AZIMUTH * ring / rings, (9.0, -7.0, 16.0)[index % 3]
