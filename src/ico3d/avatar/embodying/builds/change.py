"""How far a body's surface moves at rest, from the build it was recorded in to another one.

The file `builds.safetensors` (scripts/make_builds.py) says it for points of MakeHuman's body. They
are laid upon any rig of that kind, and what lies around them moves with those nearest to it.
"""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from safetensors import safe_open
from scipy.spatial import KDTree

from ico3d.avatar.embodying.builds.names import BuildName
from ico3d.errors import BundleError
from ico3d.rig.rig import Rig

DATA = Path(__file__).parents[2] / "data" / "builds.safetensors"
UNIT = 1e-4
"""Metres per unit of lengths in the file."""
NEAREST = 24
"""Points of the file that move a place: their weights fall to 0 at the farthest of them."""
HIPS = ("root", "spine05", "upperleg01.L")
"""Joints on which the left half of the hips hangs."""
WIDEST = 0.8
"""Share of the points on the hips that are nearer to their middle than those that say how wide."""
SIDES = (".L", ".R")
"""Ends of the names of joints of one side."""


@dataclass(frozen=True, eq=False)
class Change:
    """A change of build on one rig.

    Attributes:
        points: (A, 3) places at rest on the surface of the body, metres.
        moves: (A, 3) how far they move, metres.
        width: How many times as wide the hips become.
    """

    points: np.ndarray
    moves: np.ndarray
    width: float

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.points)

    def at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the change does at places (P, 3) at rest.

        Returns:
            (P, 3) metres by which they move, and (P, 3, 3) the derivative of where they go.
        """
        away, near = self._tree.query(places, NEAREST)  # (P, NEAREST)
        reach = np.square(away[:, -1:])  # (P, 1)
        apart = places[:, None] - self.points[near]  # (P, NEAREST, 3)
        inside = 1 - np.square(away) / reach  # (P, NEAREST)
        share = inside**3
        ratio = (1 - inside)[..., None] / reach[..., None]  # (P, NEAREST, 1)
        slope = -2 * (apart / reach[..., None] - ratio * apart[:, -1:])  # of `inside`
        slope *= 3 * np.square(inside)[..., None]  # of `share`
        total = share.sum(1)[:, None]  # (P, 1)
        moves = self.moves[near]  # (P, NEAREST, 3)
        found = np.einsum("pk,pkd->pd", share, moves) / total
        turns = np.einsum("pka,pkb->pab", moves - found[:, None], slope) / total[..., None]
        return found, np.eye(3) + turns


def change_to(build: BuildName, rig: Rig) -> Change:
    """The change from the recorded build to another one.

    Args:
        build: Which one, other than the recorded one.
        rig: The body's.

    Raises:
        BundleError: If the rig is not MakeHuman's, as `ico3d capture pose` fits it.
    """
    with safe_open(DATA, "numpy") as content:
        about = json.loads(content.metadata()["builds"])
        names = content.keys()
        tensors = {name: content.get_tensor(name) for name in names}
    lacking = [name for name in about["names"] if name not in rig.names]
    if lacking:
        raise BundleError(
            f"the body's skeleton has no joint '{lacking[0]}': only bodies on MakeHuman's skeleton "
            "(ico3d capture pose) come in other builds than their own."
        )
    names = about["names"]
    rest, points = (tensors[part] * UNIT for part in ("rest", "points"))
    places = rig.joints[[rig.names.index(name) for name in names]]  # (J, 3)
    tall = [at[names.index("head"), 1] - at[names.index("foot.L"), 1] for at in (places, rest)]
    size = float(tall[0] / tall[1])
    weights = tensors["weights"] / tensors["weights"].sum(1, keepdims=True)  # (A, 4)
    moves = tensors["moves"][about["builds"].index(build)] * (UNIT * size)
    aside = np.where(_at_hips(names, tensors["joints"], weights), points[:, 0], 0.0)  # (A,)
    wide = aside > np.quantile(aside[aside > 0], WIDEST)
    width = 1 + moves[wide, 0].mean() / (size * aside[wide].mean())
    both = np.concatenate([weights, weights])
    joints = np.concatenate([tensors["joints"], _other_side(names)[tensors["joints"]]])
    shifts = np.einsum("ak,akd->ad", both, (places - size * rest)[joints])
    return Change(size * _both_sides(points) + shifts, _both_sides(moves), float(width))


def _at_hips(names: list[str], joints: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(A,) bool: which points hang most on the joints of the hips."""
    mainly = np.take_along_axis(joints, weights.argmax(1)[:, None], 1)[:, 0]
    return np.isin(mainly, [names.index(name) for name in HIPS])


def _both_sides(half: np.ndarray) -> np.ndarray:
    """(2·A, 3) what holds on the left (A, 3), and its mirror image."""
    return np.concatenate([half, half * [-1, 1, 1]])


def _other_side(names: list[str]) -> np.ndarray:
    """(J,) index of each joint's mirror image: names end in .L and .R."""
    swapped = [
        name[:-1] + {"L": "R", "R": "L"}[name[-1]] if name[-2:] in SIDES else name for name in names
    ]
    return np.array([names.index(name) for name in swapped])
