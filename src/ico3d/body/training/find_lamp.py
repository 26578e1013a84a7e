"""Finds how a person is lit, from pictures alone: light from all around, and the strongest lamp.

Points of the template's surface keep their own colour while the person moves; what changes is
light. A regression of that on where points face, and on whether a lamp reaches them, finds the
lamp: shadows fit in one direction only.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize

from ico3d.body.planning.windows import Window
from ico3d.body.skinning.blending import blended
from ico3d.body.skinning.kinematics import transforms
from ico3d.body.skinning.light import lamp_lit
from ico3d.body.skinning.shadow import lamp_axes, posed_casters, reached
from ico3d.body.skinning.template import hung_logits, sampled
from ico3d.body.training.surface_points import seen_colors
from ico3d.capture.capture import Capture
from ico3d.common.spread import directions
from ico3d.rig.body_track import BodyTrack
from ico3d.splat import harmonics

POINTS = 2_500
"""On the skin, whose colours are compared."""
MOMENTS = 9
"""At which they are."""
DIRECTIONS = 120
"""Tried first, all around."""
FINER = (10.0, 5.0, 2.5)
"""Degrees about the best direction, tried next."""
RING = 6
"""Directions about the best one, at each of these angles."""
COARSE = (0.4, 0.8, 1.6)
"""Strengths of the lamp with which directions are compared."""
RIDGE = 1e-3
"""Of the harmonics' own squares, by which light is held at 0: turns about one axis alone do not
tell all of it."""
STRENGTHS = np.geomspace(0.02, 8, 40)
CLIPPED = 0.02
"""Colours nearer to black or white tell no logit."""


@dataclass(frozen=True, eq=False)
class Lighting:
    """How a person is lit.

    Attributes:
        light: (8, 3) of `ico3d.body.skinning.light.lit`.
        direction: (3,) unit vector towards the strongest lamp.
        strength: (3,) logarithms, of `ico3d.body.skinning.light.lamp_lit`.
    """

    light: Tensor
    direction: Tensor
    strength: Tensor


@dataclass(frozen=True, eq=False)
class Seen:
    """P points of a skin at T moments.

    Attributes:
        colors: (T, P, 3) in [0, 1]; NaN where no picture shows a point.
        normals: (T, P, 3) unit vectors.
        reach: Gives the share of light (T, P) that reaches them from a direction (3,).
    """

    colors: Tensor
    normals: Tensor
    reach: Callable[[Tensor], Tensor]


def find_lighting(
    capture: Capture, track: BodyTrack, window: Window, casters: Mapping[str, Tensor]
) -> Lighting:
    """How the person of a capture is lit, by the pictures of a few frames of a window.

    Args:
        capture: The recording.
        track: How the person moves.
        window: The frames that may be looked at.
        casters: What casts shadows, of `ico3d.body.skinning.casters.caster_tensors`.
    """
    rng = np.random.default_rng(0)
    skin = sampled(track, POINTS, rng)
    frames = window.moments(MOMENTS)
    tables = [_table(track, frame) for frame in frames]
    hung = torch.from_numpy(skin.binding.joints.astype(np.int32)), hung_logits(skin.binding)
    rest, normals = torch.from_numpy(skin.points).float(), torch.from_numpy(skin.normals).float()
    still = torch.zeros(len(skin), 4)
    posed = [blended(table, *hung, rest, still, normals) for table in tables]
    facing = [normalize(p.normals, dim=1) for p in posed]
    spheres = [posed_casters(table, *casters.values()) for table in tables]
    colors = [
        torch.from_numpy(seen_colors(p.means.double().numpy(), capture, frame))
        for p, frame in zip(posed, frames, strict=True)
    ]

    def reach(direction: Tensor) -> Tensor:
        lit = [
            reached(p.means, n, s, direction)
            for p, n, s in zip(posed, facing, spheres, strict=True)
        ]
        return torch.stack(lit)

    return regressed(Seen(torch.stack(colors), torch.stack(facing), reach))


def regressed(seen: Seen) -> Lighting:
    """The light by which colours of points change least, once it is taken off them.

    Weighted least squares in logits, each point with a colour of its own. Directions are tried one
    by one, and finer about the best.
    """
    regression = _Regression(seen)
    found = min(map(regression.tried, _all_around()), key=lambda one: one[0])
    for degrees in FINER:
        around = [regression.tried(way) for way in _ring(found[1], degrees)]
        found = min(found, *around, key=lambda one: one[0])
    return regression.solved(found[1])


class _Regression:
    """Least squares of logits on harmonics of normals and on a lamp.

    Every point's weighted mean is taken off all that is compared, which is the same as a colour of
    its own.
    """

    def __init__(self, seen: Seen):
        """Factors the harmonics once, because no direction changes them."""
        self._seen = seen
        known = seen.colors.isfinite().all(2)  # (T, P)
        colors = seen.colors.nan_to_num(0.5).clamp(CLIPPED, 1 - CLIPPED)
        steep = (colors * (1 - colors)).mean(2)  # (T, P): colour per logit
        self._weights = known * steep.square()
        basis = harmonics.basis(seen.normals.flatten(0, 1), 2)[:, 1:]  # (T·P, 8)
        basis = self._centred(basis.unflatten(0, known.shape))
        held = (RIDGE * basis.square().sum() / 8 + 1e-6).sqrt() * torch.eye(8)
        orthogonal, self._uneven = torch.linalg.qr(torch.cat([basis, held]))  # (T·P + 8, 8)
        self._basis = orthogonal[: len(basis)]
        self._logits = self._centred(colors.logit())  # (T·P, 3)

    def tried(self, direction: Tensor) -> tuple[float, Tensor]:
        """What a lamp in a direction (3,) leaves unexplained, and that direction."""
        reach = self._seen.reach(direction)  # (T, P)
        left = [self._unexplained(direction, reach, k).sum() for k in COARSE]
        return float(torch.stack(left).min()), direction

    def solved(self, direction: Tensor) -> Lighting:
        """The light with a lamp in a direction, each of its colours as strong as fits best."""
        reach = self._seen.reach(direction)
        tried = torch.stack([self._unexplained(direction, reach, k) for k in STRENGTHS])  # (S, 3)
        strength = torch.from_numpy(STRENGTHS).float()[tried.argmin(0)].log()  # (3,)
        left = self._without(direction, reach, strength)
        light = torch.linalg.solve_triangular(self._uneven, self._basis.T @ left, upper=True)
        return Lighting(light.contiguous(), direction, strength)

    def _unexplained(self, direction: Tensor, reach: Tensor, strength: float) -> Tensor:
        """(3,) by colour: squares that a lamp of one strength leaves."""
        left = self._without(direction, reach, torch.tensor([math.log(strength)]))  # (T·P, 3)
        return left.square().sum(0) - (self._basis.T @ left).square().sum(0)

    def _without(self, direction: Tensor, reach: Tensor, strength: Tensor) -> Tensor:
        """(T·P, 3) centred logits without what a lamp adds to them."""
        return self._logits - self._centred(self._lamp(direction, reach, strength))

    def _lamp(self, direction: Tensor, reach: Tensor, strength: Tensor) -> Tensor:
        """(T, P, C) what a lamp adds to logits."""
        added = lamp_lit(self._seen.normals.flatten(0, 1), reach.flatten(), direction, strength)
        return added.unflatten(0, reach.shape)

    def _centred(self, values: Tensor) -> Tensor:
        """(T·P, C) weighted values (T, P, C) without the mean of each point."""
        weights = self._weights[:, :, None]  # (T, P, 1)
        mean = (weights * values).sum(0) / weights.sum(0).clamp_min(1e-9)  # (P, C)
        return (weights.sqrt() * (values - mean)).flatten(0, 1)


def _all_around() -> list[Tensor]:
    return list(torch.from_numpy(directions(DIRECTIONS)).float())


def _ring(middle: Tensor, degrees: float) -> list[Tensor]:
    """Directions that are so far from one."""
    axes = lamp_axes(middle)  # (3, 3)
    turns = torch.arange(RING) * (2 * math.pi / RING)  # (R,)
    across = turns.cos()[:, None] * axes[0] + turns.sin()[:, None] * axes[1]  # (R, 3)
    far = math.radians(degrees)
    return list(math.cos(far) * middle + math.sin(far) * across)


def _table(track: BodyTrack, frame: int) -> Tensor:
    """(J, 16) of `transforms` at a frame."""
    joints = torch.from_numpy(track.rig.joints).float()
    pose = torch.from_numpy(track.rotations[frame]), torch.from_numpy(track.roots[frame])
    return transforms(track.rig.parents, joints, *pose)
