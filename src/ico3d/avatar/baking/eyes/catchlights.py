"""Adds what the eyes of a baked head mirror: the small light without which eyes look dead.

A cornea mirrors a lamp at a place that depends on who looks. Gaussians whose colour does not depend
on the view learn the mean of what all cameras saw, which is next to nothing. Where eyes turn to
the visitor the place hardly moves against the iris: lamp, cornea and visitor stay as they are.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ico3d.avatar.baking.eyes.eyeballs import Eyeball
from ico3d.bundle.evaluate import coefficients
from ico3d.bundle.head import BakedHead

LAMP = (-0.5, 0.12, 1.0)
"""Where the lamp stands that eyes mirror: before the person, to the right and above, as
photographers place one."""
CORNEA, APEX = 0.0078, 0.0134
"""Metres of a cornea's radius, and from the centre of an eye to the front of its cornea
(Gullstrand's schematic eye)."""
WIDE, THIN = 0.0009, 0.0001
"""Standard deviations in metres: a lamp as wide as it is far away, and a film of tears."""
WHITE, OPEN, CLOSED = (4.2, 4.1, 4.0), 3.7, -5.5
"""Logits of its colour, and of its opacity with open eyes and with lids that are `SHUT`."""
SHUT = 0.6
"""Closure of lids, 0 to 1, at which nothing is seen of an eye's middle."""


def with_catchlights(
    head: BakedHead, balls: Sequence[Eyeball], idle: np.ndarray, shut: np.ndarray
) -> tuple[BakedHead, list[Eyeball]]:
    """Adds one Gaussian per eye, before all others: few are drawn where all are too many.

    Args:
        head: The baked head.
        balls: Its eyeballs.
        idle: (B,) expression at rest, with open eyes.
        shut: (B,) the same with lids that are `SHUT`; as `idle` where nothing drives the lids.

    Returns:
        The head with its new Gaussians, and its eyeballs, which have them.
    """
    count = len(balls)
    places = np.array([ball.centre + _glint() for ball in balls])  # (C, 3)
    basis, scale, at_rest = _hidden_by_lids(head, idle, shut)
    mean = np.array([*WHITE, OPEN - at_rest])  # (4,)
    new = {
        "means": places,
        "quats": np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        "scales": np.tile(np.log([WIDE, WIDE, THIN]), (count, 1)),
        "mean_logits": np.tile(mean, (count, 1)),
        "basis": np.tile(basis[:, None], (1, count, 1)),  # (K, C, 4)
        "basis_scale": np.full(count, scale),
        "displacement_basis": np.zeros((head.num_displacements, count, 3)),
    }
    own = np.eye(count, dtype=bool)
    return head.preceded(new), [
        replace(ball, own=np.concatenate([mine, ball.own]))
        for ball, mine in zip(balls, own, strict=True)
    ]


def _glint() -> np.ndarray:
    """(3,) metres from the centre of an eye, which looks ahead, to where its cornea mirrors `LAMP`.

    Its normal there halves the angle between the lamp and a visitor far ahead.
    """
    halfway = np.array(LAMP) / np.linalg.norm(LAMP) + (0, 0, 1)
    return CORNEA * halfway / np.linalg.norm(halfway) + (0, 0, APEX - CORNEA)


def _hidden_by_lids(
    head: BakedHead, idle: np.ndarray, shut: np.ndarray
) -> tuple[np.ndarray, float, float]:
    """How an opacity falls as lids close, and with nothing else that moves the face.

    Of all weights of the head's coefficients that have it fall from `OPEN` to `CLOSED` these are
    the shortest.

    Returns:
        Weights (K, 4), whole numbers from -127 to 127; logits per unit of them; and the logit that
        they give at rest.
    """
    weights = np.zeros((head.rank, 4))
    rest = coefficients(head, idle).astype(np.float64)  # (K,)
    step = coefficients(head, shut) - rest  # (K,)
    if not step.any():
        return weights, 1.0, 0.0
    fall = (CLOSED - OPEN) * step / (step @ step)
    unit = float(np.abs(fall).max() / 127)
    weights[:, 3] = np.round(fall / unit)
    return weights, unit, float(unit * weights[:, 3] @ rest)
