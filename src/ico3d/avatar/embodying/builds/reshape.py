"""Gives a baked body on a skeleton another build."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ico3d.avatar.embodying.builds.change import Change, change_to
from ico3d.avatar.embodying.builds.names import MEDIUM, BuildName
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import gesture_files
from ico3d.bundle.skinned.lamp import POINT_UNIT, BakedLamp
from ico3d.bundle.tensors import QUAT_UNIT
from ico3d.motion.recorded.cut import Cut
from ico3d.rig.quaternions import from_matrix, normalized, to_matrix

STRETCH = 1.3
"""Most by which a Gaussian grows or shrinks in any direction.

Surfaces stay within it; inside of an arm, where front and back move apart, what lies there would
be drawn out until it shows outside.
"""
FELT = 1e-5
"""Least change of direction or length that is more than half a unit of the numbers kept."""
SMALLEST = 1e-30
"""Least size of a Gaussian in metres, which has a logarithm."""
NORMAL_UNIT = 127
SHAPE_UNIT = 127
"""Largest whole number of normals, and of residual shapes."""


def reshaped(body: BakedSkinned, build: BuildName) -> BakedSkinned:
    """A body in another build; its skeleton, motion, head, hands and shoes stay as they are.

    Each Gaussian moves with the surface about it, and is stretched as that is; so do the spheres
    that cast the shadow. Residual shapes and normals turn with it.

    Args:
        body: The body as it was recorded.
        build: The build; `medium` gives the same body.

    Raises:
        BundleError: If the body's skeleton is not MakeHuman's.
    """
    if build == MEDIUM:
        return body
    change = change_to(build, body.rig)
    means = body.means.astype(np.float64)
    moves, slopes = change.at(means)  # (N, 3), (N, 3, 3)
    slopes = _bounded(slopes)
    touched = np.abs(slopes - np.eye(3)).max((1, 2)) > FELT
    parts = _stretched(body, slopes) if touched.any() else {}
    kept = {
        name: np.where(_like(touched, new), new, getattr(body, name)) for name, new in parts.items()
    }
    info = replace(
        body.info,
        low=_beyond(body.info.low, -np.abs(moves).max(0)),
        high=_beyond(body.info.high, np.abs(moves).max(0)),
    )
    return replace(
        body, means=(means + moves).astype(np.float32), **kept, info=info, lamp=_lamp(body, change)
    )


def gestures_in(body: BakedSkinned, build: BuildName, cuts: Sequence[Cut]) -> dict[str, bytes]:
    """The file of gestures of a body in another build: arms hang, and hands pass, beside it.

    Args:
        body: The body in that build.
        build: The build.
        cuts: Gestures in the recording.

    Returns:
        Content of the file by its name.
    """
    return gesture_files(body, cuts, change_to(build, body.rig).width)


def _bounded(slopes: np.ndarray) -> np.ndarray:
    """The same changes (N, 3, 3), none of which stretches or squeezes by more than `STRETCH`."""
    axes, lengths, turns = np.linalg.svd(slopes)
    bounded = (axes * lengths.clip(1 / STRETCH, STRETCH)[:, None]) @ turns
    outside = np.abs(np.log(lengths)).max(1, keepdims=True)[..., None] > np.log(STRETCH)
    return np.where(outside, bounded, slopes)


def _stretched(body: BakedSkinned, slopes: np.ndarray) -> dict[str, np.ndarray]:
    """Tensors of Gaussians whose surroundings change by slopes (N, 3, 3)."""
    turns = to_matrix(normalized(body.quats.astype(np.float64)))  # (N, 3, 3)
    sizes = np.exp(body.log_scales.astype(np.float64))  # (N, 3)
    axes, lengths, _ = np.linalg.svd(slopes @ (turns * sizes[:, None]))
    axes[:, :, 2] *= np.linalg.det(axes)[:, None]
    facing = np.linalg.solve(slopes.transpose(0, 2, 1), body.normals[..., None].astype(np.float64))
    shapes, scales = _turned(body, slopes)
    return {
        "quats": np.rint(from_matrix(axes) * QUAT_UNIT).astype(np.int16),
        "log_scales": np.log(lengths.clip(SMALLEST)).astype(np.float16),
        "normals": _whole(facing[..., 0], NORMAL_UNIT),
        "shapes": shapes,
        "shape_scales": scales,
    }


def _turned(body: BakedSkinned, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The residual shapes of position after such a change, and their scales."""
    shapes, scales = body.shapes.copy(), body.shape_scales.astype(np.float64)
    moves = np.einsum("nab,nkb->nka", slopes, shapes[..., :3].astype(np.float64))
    most = np.abs(moves).max((1, 2))  # (N,)
    grown = np.maximum(most / SHAPE_UNIT, 1.0)  # one unit becomes larger where it must
    shapes[..., :3] = np.rint(moves / grown[:, None, None])
    scales[:, 0] *= grown
    return shapes, scales.astype(np.float16)


def _lamp(body: BakedSkinned, change: Change) -> BakedLamp | None:
    if body.lamp is None:
        return None
    points = body.lamp.caster_points * POINT_UNIT
    moved = np.rint((points + change.at(points)[0]) / POINT_UNIT)
    far = np.iinfo(np.int16)
    return replace(body.lamp, caster_points=moved.clip(far.min, far.max).astype(np.int16))


def _whole(vectors: np.ndarray, unit: int) -> np.ndarray:
    """(N, 3) int8 of the same directions; zero stays zero."""
    most = np.abs(vectors).max(1, keepdims=True)
    return np.rint(vectors * (unit / np.maximum(most, 1e-9))).astype(np.int8)


def _like(touched: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(N, 1, …) with as many axes as values."""
    return touched.reshape(-1, *[1] * (values.ndim - 1))


def _beyond(corner: tuple[float, float, float], by: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(a + b), 5) for a, b in zip(corner, by, strict=True))
    return x, y, z
