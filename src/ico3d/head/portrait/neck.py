"""Where the neck of a portrait bends, and how.

From the chin down to the collar the head's movement gives way to that of the shoulders.
"""

from dataclasses import dataclass, replace

from torch import Tensor

from ico3d.splat.gaussians import Gaussians
from ico3d.splat.quaternions import from_matrix, multiply

BENDS = (1.03, 1.35)
"""Distances from the middle of the head, relative to that of the chin, between which it bends."""
BELOW = (0.45, 0.85)
"""How far below the middle of the head, relative to the same, shoulders begin: hair is no neck."""


@dataclass(frozen=True)
class Neck:
    """Where in canonical head space a portrait's neck bends.

    Attributes:
        middle: Middle of the head between the ears, in metres.
        reach: Distance in metres from there to the chin.
        width: Width of the jaw in metres.
    """

    middle: tuple[float, float, float]
    reach: float
    width: float

    def follows(self, means: Tensor) -> Tensor:
        """(N,) how much of the shoulders' movement is made at (N, 3), 0 to 1."""
        away = means.detach() - means.new_tensor(self.middle)  # (N, 3)
        distance = _eased(away.norm(dim=1) / self.reach, *BENDS)  # (N,)
        return distance * _eased(-away[:, 1] / self.reach, *BELOW)


def _eased(values: Tensor, begin: float, end: float) -> Tensor:
    """From 0 where values reach `begin` to 1 at `end`, without a kink."""
    share = ((values - begin) / (end - begin)).clamp(0, 1)
    return share * share * (3 - 2 * share)


def bent(gaussians: Gaussians, share: Tensor, motion: Tensor) -> Gaussians:
    """Gaussians in canonical head space whose shoulders have moved.

    Args:
        gaussians: N Gaussians.
        share: (N,) how much of the motion each makes, 0 to 1; see `Neck.follows`.
        motion: (4, 4) rigid motion of the shoulders against the head.

    Returns:
        The same Gaussians, each moved by its share of the motion.
    """
    motion = motion.to(gaussians.means)
    share = share.to(gaussians.means)[:, None]  # (N, 1)
    moved = gaussians.means @ motion[:3, :3].T + motion[:3, 3]  # (N, 3)
    turn = from_matrix(motion[:3, :3])  # (4,)
    turn = turn * turn[0].sign()  # the short way
    still = turn.new_tensor([1.0, 0, 0, 0])
    turns = still + share * (turn - still)  # (N, 4)
    return replace(
        gaussians,
        means=gaussians.means + share * (moved - gaussians.means),
        quats=multiply(turns, gaussians.quats),
    )
