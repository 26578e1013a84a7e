"""Which Gaussians of a body are skin, and which are hair, told by where they hang and by colour."""

from dataclasses import dataclass

import numpy as np

from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.motion.roles import SIDES, Cast, arm_roles

SHARPNESS = 6.0
"""How sharply a Gaussian is told to be of one kind, per squared logit of distance."""
BRIGHTNESS = 0.5
"""How much brightness counts beside hue: folds and shadows change it, and are no other stuff."""


@dataclass(frozen=True)
class Surfaces:
    """What the N Gaussians of a body are.

    Attributes:
        head: (N,) bool, whether the joint of the head carries a Gaussian most.
        skin: (N,) in [0, 1], how much of it is skin.
        hair: (N,) in [0, 1], how much of it is hair.
    """

    head: np.ndarray
    skin: np.ndarray
    hair: np.ndarray


def surfaces_of(body: BakedSkinned, cast: Cast, behind: np.ndarray) -> Surfaces:
    """Tells skin, hair and clothes apart.

    Hands are skin, what is behind the face above the ears is hair, chest and back are clothes; any
    other Gaussian is what its colour is most like. Of the head nothing is clothes; of hips and legs
    all is.

    Args:
        body: The body.
        cast: Joints of its rig by role.
        behind: (N,) bool, Gaussians that are behind the face and above the ears.
    """
    mainly = main_joints(body)  # (N,)

    def on(*roles: str) -> np.ndarray:
        joints = [joint for role in roles for joint in cast.joints.get(role, ())]
        return np.isin(mainly, joints)

    fingers = on(*(role for side in SIDES for role in arm_roles(side)[4:]))
    trunk, head = on("spine", "chest"), on("head")
    solid, colors = body.opacities > 127, features(body.color_logits)
    known = [colors[kind & solid] for kind in (fingers, head & behind, trunk)]
    middles = [np.median(part, axis=0) if len(part) else np.full(3, np.inf) for part in known]
    away = np.square(colors[:, None] - np.array(middles)).sum(2)  # (N, 3): skin, hair, clothes
    away[head, 2] = np.inf
    away[~(head | trunk | on("neck")), 1] = np.inf
    share = np.exp(-SHARPNESS * (away - away.min(1, keepdims=True)))
    share /= share.sum(1, keepdims=True)
    share[on("hips") | np.isin(mainly, legs(cast))] = 0, 0, 1
    return Surfaces(head, share[:, 0], share[:, 1])


def main_joints(body: BakedSkinned) -> np.ndarray:
    """(N,) index of the joint that carries each Gaussian most."""
    return np.take_along_axis(body.joints, body.weights.argmax(1)[:, None], 1)[:, 0]


def features(logits: np.ndarray) -> np.ndarray:
    """(N, 3) two numbers of hue and one of brightness, of colours (N, 3) in logits."""
    red, green, blue = logits.astype(np.float64).T
    return np.stack([red - green, green - blue, BRIGHTNESS * (red + green + blue) / 3], 1)


def legs(cast: Cast) -> list[int]:
    """Joints of the legs, those without a role among them."""
    legs = {joint for side in SIDES for joint in cast.joints[f"{side}_hip"]}
    for joint, parent in enumerate(cast.rig.parents):
        if parent in legs:
            legs.add(joint)
    return sorted(legs)
