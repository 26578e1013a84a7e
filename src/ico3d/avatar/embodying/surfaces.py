"""Which Gaussians of a body are skin, and which are hair, told by where they hang and by colour."""

from dataclasses import dataclass

import numpy as np

from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.motion.roles import SIDES, Cast, arm_roles

SHARPNESS = 4.0
"""How sharply a Gaussian is told to be of one kind, per squared logit of distance."""


@dataclass(frozen=True)
class Surfaces:
    """Shares in [0, 1] of the N Gaussians of a body.

    Attributes:
        head: (N,) bool, whether the joint of the head carries a Gaussian most.
        skin: (N,) how much of it is skin.
        hair: (N,) how much of it is hair.
    """

    head: np.ndarray
    skin: np.ndarray
    hair: np.ndarray


def surfaces_of(body: BakedSkinned, cast: Cast, behind: np.ndarray) -> Surfaces:
    """Tells skin, hair and clothes apart.

    Hands are skin, what is behind the face above the ears is hair, trunk and legs are clothes; any
    other Gaussian is what its colour is most like. What hangs on trunk and legs is never hair.

    Args:
        body: The body.
        cast: Joints of its rig by role.
        behind: (N,) bool, Gaussians that are behind the face and above the ears.
    """
    mainly = np.take_along_axis(body.joints, body.weights.argmax(1)[:, None], 1)[:, 0]  # (N,)

    def on(*roles: str) -> np.ndarray:
        joints = [joint for role in roles for joint in cast.joints.get(role, ())]
        return np.isin(mainly, joints)

    hands = on(*(role for side in SIDES for role in arm_roles(side)[3:]))
    legs = on(*(f"{side}_{part}" for side in SIDES for part in ("hip", "knee", "ankle")))
    trunk, head = on("hips", "spine", "chest"), on("head")
    solid = body.opacities > 127
    colors = body.color_logits.astype(np.float64)  # (N, 3)
    known = [colors[kind & solid] for kind in (hands, head & behind, trunk, legs)]
    middles = [np.median(part, axis=0) if len(part) else np.full(3, np.inf) for part in known]
    away = np.square(colors[:, None] - np.array(middles)).sum(2)  # (N, M)
    share = np.exp(-SHARPNESS * (away - away.min(1, keepdims=True)))
    share /= share.sum(1, keepdims=True)
    upper = head | on("neck")
    return Surfaces(head, np.where(legs, 0, share[:, 0]), np.where(upper, share[:, 1], 0))
