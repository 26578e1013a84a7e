"""What the manifest says about a body on a skeleton."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ico3d.bundle import limits
from ico3d.errors import BundleError
from ico3d.rig.rig import MOST_JOINTS, Rig

SKINNED = "body/skinned.safetensors"
"""The file of a body on a skeleton."""
LONGEST_NAME = 64
"""Characters of a joint's name."""

Require = Callable[[bool, str, str], None]
"""Refuses what does not hold: whether it holds, the field, and what the field must do."""


@dataclass(frozen=True)
class SkinnedInfo:
    """The counts that the tensors of `body/skinned.safetensors` must agree with, and the rig.

    Attributes:
        fps: Recorded frames per second; frame i is at i / fps seconds.
        num_frames: F, recorded poses.
        num_gaussians: N.
        num_shapes: K, residual shapes.
        num_moving: M, joints that turn in the recording.
        num_known: P, recorded poses that tell the coefficients of any other pose.
        names: J names of joints.
        parents: J numbers, each smaller than its own; −1 for joint 0, the only root.
        low: Least coordinates that its Gaussians' centres reach, metres.
        high: Greatest coordinates.
    """

    fps: float
    num_frames: int
    num_gaussians: int
    num_shapes: int
    num_moving: int
    num_known: int
    names: tuple[str, ...]
    parents: tuple[int, ...]
    low: tuple[float, float, float]
    high: tuple[float, float, float]

    @property
    def num_joints(self) -> int:
        """J."""
        return len(self.names)

    def rig(self, joints: np.ndarray) -> Rig:
        """The rig with joints (J, 3) at rest.

        Raises:
            BundleError: If it is none.
        """
        try:
            return Rig(self.names, self.parents, joints.astype(np.float64))
        except ValueError as error:
            raise BundleError(f"{SKINNED}: {error}.") from error


def check_skinned(info: SkinnedInfo, require: Require) -> None:
    """Checks ranges, and that the rig is a tree.

    Raises:
        BundleError: By `require`, naming the first field that is wrong.
    """
    ranges = {
        "num_frames": (2, limits.MAX_POSED_FRAMES),
        "num_gaussians": (1, limits.MAX_GAUSSIANS),
        "num_shapes": (1, limits.MAX_SHAPES),
        "num_moving": (1, min(info.num_joints, MOST_JOINTS)),
        "num_known": (1, min(info.num_frames, limits.MAX_KNOWN_POSES)),
    }
    for name, (least, most) in ranges.items():
        inside = least <= getattr(info, name) <= most
        require(inside, f"skinned.{name}", f"lie between {least} and {most}")
    require(0 < info.fps <= 1000, "skinned.fps", "lie between 0 and 1000")
    named = all(0 < len(name) <= LONGEST_NAME for name in info.names)
    require(named, "skinned.names", f"have 1 to {LONGEST_NAME} characters each")
    ordered = all(a <= b for a, b in zip(info.low, info.high, strict=True))
    require(ordered, "skinned.low", "be at most skinned.high")
    try:
        Rig(info.names, info.parents, np.zeros((info.num_joints, 3)))
    except ValueError as error:
        require(False, "skinned.parents", f"make a rig: {error}")
