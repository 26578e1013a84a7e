"""The manifest's entry about a body on a skeleton."""

from dataclasses import dataclass

import numpy as np

from ico3d.bundle import limits
from ico3d.bundle.limits import Require
from ico3d.errors import BundleError
from ico3d.rig.rig import MOST_JOINTS, Rig

SKINNED = "body/skinned.safetensors"
"""Name of the file of a body on a skeleton."""
SKINNED_REST = "body/skinned_rest.safetensors"
"""Name of the file with its less important Gaussians, where there is one."""
LONGEST_NAME = 64
"""Most characters of a joint's name."""


@dataclass(frozen=True)
class SkinnedInfo:
    """Counts of the tensors of `body/skinned.safetensors`, and the tree of the rig.

    Attributes:
        fps: Recorded frames per second; frame i is at i / fps seconds.
        num_frames: Number F of recorded frames.
        num_gaussians: Number N of Gaussians.
        num_shapes: Number K of residual shapes.
        num_moving: Number M of joints that turn in the recording.
        num_known: Number P of recorded poses from which coefficients of others are interpolated.
        names: Names of the J joints.
        parents: Index of each joint's parent, which is smaller than the joint's own; −1 for joint
            0, the only root.
        low: Least x, y, z of the Gaussians' centres in the recording, metres.
        high: Greatest x, y, z of the Gaussians' centres in the recording, metres.
        num_casters: Number of spheres that cast shadows; 0 without a lamp.
        num_rest: Number of the Gaussians in `body/skinned_rest.safetensors`, the least important
            ones; 0 where all are in one file.
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
    num_casters: int = 0
    num_rest: int = 0

    @property
    def num_joints(self) -> int:
        """Number J of joints."""
        return len(self.names)

    def rig(self, joints: np.ndarray) -> Rig:
        """The rig with joints at positions (J, 3) at rest, metres.

        Raises:
            BundleError: If names, parents and positions do not make a rig.
        """
        try:
            return Rig(self.names, self.parents, joints.astype(np.float64))
        except ValueError as error:
            raise BundleError(f"{SKINNED}: {error}.") from error


def check_skinned(info: SkinnedInfo, require: Require) -> None:
    """Checks ranges, and that the rig is a tree.

    Args:
        info: The entry.
        require: Called for each check; it raises the error.

    Raises:
        BundleError: If a check fails; the error names the field.
    """
    ranges = {
        "num_frames": (2, limits.MAX_POSED_FRAMES),
        "num_gaussians": (1, limits.MAX_GAUSSIANS),
        "num_shapes": (1, limits.MAX_SHAPES),
        "num_moving": (1, min(info.num_joints, MOST_JOINTS)),
        "num_casters": (0, limits.MAX_CASTERS),
        "num_rest": (0, info.num_gaussians - 1),
        "num_known": (1, min(info.num_frames, limits.MAX_KNOWN_POSES)),
    }
    for name, (least, most) in ranges.items():
        inside = least <= getattr(info, name) <= most
        require(inside, f"skinned.{name}", f"lie between {least} and {most}")
    require(limits.MIN_FPS <= info.fps <= limits.MAX_FPS, "skinned.fps", limits.FPS_RANGE)
    named = all(0 < len(name) <= LONGEST_NAME for name in info.names)
    require(named, "skinned.names", f"have 1 to {LONGEST_NAME} characters each")
    ordered = all(a <= b for a, b in zip(info.low, info.high, strict=True))
    require(ordered, "skinned.low", "be at most skinned.high")
    try:
        Rig(info.names, info.parents, np.zeros((info.num_joints, 3)))
    except ValueError as error:
        require(False, "skinned.parents", f"make a rig: {error}")
