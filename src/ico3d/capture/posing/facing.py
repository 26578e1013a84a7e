"""Brings a fitted head where the recorded head poses say that it was.

MediaPipe sees eyes, ears and nose of somebody who looks aside too near to the front, so a skeleton
that is fitted to them turns its head too little: by a fifth of the angle, on synthetic people. A
recording with head poses knows better.
"""

from dataclasses import replace

import numpy as np

from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import (
    conjugate,
    continuous,
    from_matrix,
    from_rotvec,
    multiply,
    to_rotvec,
)
from ico3d.rig.rig import Rig

NECK = ("neck01", "neck02", "neck03", "head")
"""Joints from the neck to the head, which share a correction equally."""
LARGEST = np.radians(25.0)
"""Largest correction in radians; where a head pose asks for more, it is taken to be wrong."""


def facing(track: BodyTrack, poses: list[np.ndarray | None]) -> BodyTrack:
    """The track with heads that turn and lean as recorded; neck and head move, nothing else.

    How the recorded head's axes lie in the head's joint is found first, as the mean over the
    frames; so a constant difference between both corrects nothing.

    Args:
        track: A track whose rig has the joints of `NECK`; without them it is returned as it is.
        poses: (4, 4) world from canonical head space of each frame; None where it is not known.
    """
    known = np.array([pose is not None and bool(np.isfinite(pose).all()) for pose in poses])
    if not (known & track.fitted).any() or not set(NECK) <= set(track.rig.names):
        return track
    chain = [track.rig.index(name) for name in NECK]
    rotations = track.rotations.astype(np.float64)  # (F, J, 4)
    world = track.rig.posed(rotations, track.roots.astype(np.float64))[0]  # (F, J, 4)
    head = world[:, chain[-1]]  # (F, 4)
    eye = np.eye(4)
    matrices = np.stack(
        [p if k and p is not None else eye for p, k in zip(poses, known, strict=True)]
    )
    recorded = from_matrix(matrices[:, :3, :3])  # (F, 4)
    held = _mean(multiply(conjugate(head), recorded)[known & track.fitted])  # (4,)
    change = to_rotvec(multiply(multiply(recorded, conjugate(held)), conjugate(head)))  # (F, 3)
    off = ~known | (np.linalg.norm(change, axis=1) > LARGEST)
    change[off] = 0.0
    shares = np.arange(1, len(chain) + 1) / len(chain)
    turns = from_rotvec(change[:, None] * shares[:, None])  # (F, N, 4)
    rotations = _turned(track.rig, rotations, world, chain, turns)
    swings = _swings(track, rotations, chain, matrices, off)  # (F, 4)
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(swings), 1))  # the head itself keeps its direction
    world = track.rig.posed(rotations, track.roots.astype(np.float64))[0]
    each = np.stack([*[swings] * (len(chain) - 1), upright], 1)  # (F, N, 4)
    rotations = _turned(track.rig, rotations, world, chain, each)
    return replace(track, rotations=continuous(rotations).astype(np.float32))


def _turned(
    rig: Rig, rotations: np.ndarray, world: np.ndarray, chain: list[int], turns: np.ndarray
) -> np.ndarray:
    """Local rotations (F, J, 4) after each joint of a chain was turned in the world.

    Args:
        rig: The skeleton.
        rotations: (F, J, 4) local rotations before.
        world: (F, J, 4) rotations of the joints in the world before.
        chain: N joints, each the parent of the next.
        turns: (F, N, 4) rotations in the world.
    """
    out = rotations.copy()
    above = world[:, rig.parents[chain[0]]]  # (F, 4)
    for number, joint in enumerate(chain):
        turned = multiply(turns[:, number], world[:, joint])
        out[:, joint] = multiply(conjugate(above), turned)
        above = turned
    return out


def _swings(
    track: BodyTrack,
    rotations: np.ndarray,
    chain: list[int],
    matrices: np.ndarray,
    off: np.ndarray,
) -> np.ndarray:
    """(F, 4) rotations about the neck's base that bring the head's joint where it was recorded.

    Args:
        track: The track.
        rotations: (F, J, 4) local rotations, with heads that are turned as recorded.
        chain: Joints from the neck to the head.
        matrices: (F, 4, 4) recorded head poses.
        off: (F,) bool: frames that are left as they are.
    """
    places = track.rig.posed(rotations, track.roots.astype(np.float64))[1]  # (F, J, 3)
    base, head = places[:, chain[0]], places[:, chain[-1]]  # (F, 3)
    turn, shift = matrices[:, :3, :3], matrices[:, :3, 3]
    local = np.einsum("fba,fb->fa", turn, head - shift)  # (F, 3)
    held = local[~off & track.fitted].mean(0) if (~off & track.fitted).any() else local.mean(0)
    wanted = turn @ held + shift - base  # (F, 3)
    ways = np.stack([head - base, wanted])
    one, other = ways / np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), 1e-9)
    axis = np.cross(one, other)  # (F, 3)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, (one * other).sum(1, keepdims=True))
    swing = axis / np.maximum(sine, 1e-12) * np.minimum(angle, LARGEST)
    swing[off] = 0.0
    return from_rotvec(swing)


def _mean(quats: np.ndarray) -> np.ndarray:
    """(4,) mean rotation of (N, 4): Markley et al., "Averaging quaternions"."""
    return np.linalg.eigh(quats.T @ quats)[1][:, -1]
