"""Lets a person look at a point: both eyes turn until they meet there, whatever the head does."""

from dataclasses import replace

import numpy as np

from ico3d.studio.acting.performance import Performance
from ico3d.studio.person.subject import Material, Subject

KAPPA = float(np.radians(4.5))
"""Angle in radians from the line of sight outwards to the axis through the pupil.

The spot of sharpest sight lies beside the eye's pole, so that the pupils of people who look at one
stand a little apart; eyes whose axes meet on the visitor seem to squint.
"""
GAZES = ("visitor", "ahead")
"""Where a person looks between glances: at who stands before the first camera, or straight ahead
of the head."""


def looking(subject: Subject, acted: Performance, point: np.ndarray) -> Performance:
    """The performance with the sight on a point in the world; glances leave it and come back.

    Args:
        subject: The person.
        acted: The performance.
        point: (3,) metres.
    """
    weights = acted.weights.copy()
    for eye, side, outward in zip(subject.eyes, ("Left", "Right"), (1.0, -1.0), strict=True):
        across = np.array([_turn(subject, f"eyeLook{way}{side}")[0] for way in ("Out", "In")])
        height = np.array([_turn(subject, f"eyeLook{way}{side}")[1] for way in ("Up", "Down")])
        inverse = np.linalg.inv(acted.world_from_head)  # (F, 4, 4)
        towards = inverse[:, :3, :3] @ point + inverse[:, :3, 3] - eye.centre  # (F, 3)
        yaw, pitch = _angles(towards)
        ahead = _angles(eye.axis)
        pairs = (
            (("Out", "In"), across * (outward, outward), outward * (yaw - ahead[0]) + KAPPA),
            (("Up", "Down"), height, pitch - ahead[1]),
        )
        for (one, other), (most, least), wanted in pairs:
            names = (f"eyeLook{one}{side}", f"eyeLook{other}{side}")
            if not set(names) <= set(subject.blendshape_names) or most <= 0 or least >= 0:
                continue
            first, second = (subject.blendshape_names.index(name) for name in names)
            now = weights[:, first] * most + weights[:, second] * least  # (F,)
            total = now + wanted
            weights[:, first] = np.clip(total / most, 0, 1)
            weights[:, second] = np.clip(total / least, 0, 1)
    return replace(acted, weights=weights)


def _angles(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angles (...,) to the person's left, and upwards, of directions (..., 3), radians."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))


def _turn(subject: Subject, name: str) -> tuple[float, float]:
    """Angles to the person's left, and upwards, by which a blendshape turns its eye, radians."""
    side = 0 if name.endswith("Left") else 1
    eye = subject.eyes[side]
    ball = np.unique(subject.faces[subject.materials == Material.EYE])
    ball = ball[(subject.vertices[ball, 0] > 0) == (side == 0)]
    if name not in subject.blendshape_names or len(ball) < 4:
        return 0.0, 0.0
    rest = subject.vertices[ball] - eye.centre
    moved = subject.posed(subject.weights({name: 1.0}))[ball] - eye.centre
    # Small rotations about a centre: least squares of moved − rest = ω × rest.
    x, y, z = rest.T.astype(float)
    o = np.zeros_like(x)
    cross = np.stack([np.stack([o, z, -y], 1), np.stack([-z, o, x], 1), np.stack([y, -x, o], 1)], 1)
    omega = np.linalg.lstsq(cross.reshape(-1, 3), (moved - rest).ravel(), rcond=None)[0]
    return float(omega[1]), float(-omega[0])
