"""Refines head poses by following points of the rigid face through the pictures.

Landmarks are estimates of a network and jitter by about a pixel. Points on skin, nose and glasses
are therefore followed from reference frames into every frame (Lucas-Kanade), and poses are fitted
to the positions found. The results of several references are averaged, so that no single frame's
error is passed on.

Only position, size and rotation in the image plane come from these points, because patches of a
nearly flat face hardly distinguish rotation out of the plane from translation. Fitted freely on a
real clip, that rotation shrank to a quarter of what all landmarks agree on, and hair and shoulders
were off by 20 pixels. Rotation out of the plane therefore comes from landmarks, smoothed over time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.capture.portrait import rigid_head
from ico3d.capture.portrait.rigid_head import Track
from ico3d.common.savitzky_golay import filtered

REFERENCES = 8
"""Number of reference frames, spread over the head poses of the clip."""
NEAREST = 4
"""Number of references, closest in pose, that each frame is compared with."""
ROUNDS = 3
SMOOTHING = (9, 2)
"""Savitzky-Golay filter for rotations out of the image plane: window in frames, degree."""
PATCH = 21
"""Side in pixels of the patches that are followed, for a face 250 pixels wide."""


@dataclass(frozen=True)
class Reference:
    """A frame with which others are compared.

    Attributes:
        index: Index of the frame in the track.
        image: (H, W) uint8 grey picture.
    """

    index: int
    image: np.ndarray


def align(track: Track, rigid: np.ndarray, load: Callable[[int], np.ndarray]) -> Track:
    """Refines the poses of a track so that they agree with the pictures.

    Args:
        track: Shape, focal length and poses from landmarks, `smoothed`.
        rigid: (K,) bool: landmarks that do not move with the expression.
        load: Returns the grey picture (H, W) uint8 of a frame, given its index in the track.

    Returns:
        The track with refined poses; shape and focal length are unchanged.
    """
    references = [Reference(i, load(i)) for i in spread_poses(track, REFERENCES)]
    part = replace(track, shape=track.shape[rigid], sigmas=np.ones(int(rigid.sum())))
    for _ in range(ROUNDS):
        found = follow(part, references, load)  # (F, k, 2)
        weighted = replace(part, sigmas=_spreads(part, found))
        part = rigid_head.place(weighted, found, part.poses(), rigid_head.IN_PLANE)
    return replace(track, rotations=part.rotations, translations=part.translations)


def smoothed(track: Track) -> Track:
    """The track through consecutive frames without the landmarks' jitter of rotations."""
    return replace(track, rotations=_smooth(track.rotations))


def _smooth(rotations: np.ndarray) -> np.ndarray:
    """Rotations (F, 3, 3) without the landmarks' jitter; fewer frames than the window stay."""
    window, degree = SMOOTHING
    if len(rotations) < window:
        return rotations
    middle = Rotation.from_matrix(rotations).mean()
    turns = (middle.inv() * Rotation.from_matrix(rotations)).as_rotvec()  # (F, 3)
    smooth = filtered(turns, window, degree)
    return (middle * Rotation.from_rotvec(smooth)).as_matrix()


def rigid_landmarks(canonical: np.ndarray) -> np.ndarray:
    """(K,) bool: nose, cheekbones and temples of the canonical face (K, 3), metres.

    Lips, jaw, lids and brows move with the expression, and landmarks of the outline slide over the
    skin.
    """
    x, y, z = np.abs(canonical[:, 0]), canonical[:, 1], canonical[:, 2]
    nose = (x < 0.022) & (y > -0.016) & (y < 0.045)
    cheekbones = (x > 0.022) & (x < 0.06) & (y > -0.008) & (y < 0.018) & (z > 0.01)
    temples = (x > 0.05) & (x < 0.068) & (y > 0.018) & (y < 0.05) & (z > 0.0)
    return nose | cheekbones | temples


def spread_poses(track: Track, count: int) -> list[int]:
    """Frames whose head poses lie far apart (farthest-point choice), ascending."""
    turns = Rotation.from_matrix(track.rotations).as_rotvec()
    features = np.concatenate([turns, track.translations], 1)  # radians and metres are alike here
    middle = np.median(features, axis=0)
    chosen = [int(np.linalg.norm(features - middle, axis=1).argmin())]
    while len(chosen) < min(count, len(features)):
        away = np.linalg.norm(features[:, None] - features[chosen], axis=-1).min(1)
        chosen.append(int(away.argmax()))
    return sorted(set(chosen))


def follow(
    track: Track, references: Sequence[Reference], load: Callable[[int], np.ndarray]
) -> np.ndarray:
    """Positions of the rigid points in all pictures.

    Args:
        track: Shape and poses to start from.
        references: Frames to compare with.
        load: Returns the grey picture (H, W) uint8 of a frame, given its index in the track.

    Returns:
        (F, K, 2) pixels: mean over the references, or the projected point where none finds it.
    """
    pixels = track.project()
    width = np.ptp(pixels[:, :, 0], axis=1).mean()
    patch = int(np.clip(round(PATCH * width / 110), 9, 41)) | 1
    found = pixels.copy()
    for frame in range(len(pixels)):
        image = load(frame)
        seen = [
            _flow(reference.image, image, pixels[reference.index], pixels[frame], patch)
            for reference in _nearest(track, references, frame)
        ]
        moves = np.stack(seen) - pixels[frame]  # (R, K, 2), NaN where lost
        known = np.isfinite(moves[..., 0])
        total = np.where(known[..., None], moves, 0.0).sum(0)
        found[frame] += total / np.maximum(known.sum(0), 1)[:, None]
    return found


def _nearest(track: Track, references: Sequence[Reference], frame: int) -> list[Reference]:
    """The references closest in pose to a frame, the frame itself excepted."""
    here = Rotation.from_matrix(track.rotations[frame])

    def away(reference: Reference) -> float:
        there = Rotation.from_matrix(track.rotations[reference.index])
        return float((here * there.inv()).magnitude())

    others = [reference for reference in references if reference.index != frame]
    return sorted(others or references, key=away)[:NEAREST]


def _flow(
    before: np.ndarray, after: np.ndarray, points: np.ndarray, guess: np.ndarray, patch: int
) -> np.ndarray:
    """(K, 2) where points of one picture lie in another, NaN where that is not sure."""
    import cv2

    settings = {
        "winSize": (patch, patch),
        "maxLevel": 1,
        "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
        "criteria": (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.003),
    }
    start, first = ((p - 0.5).astype(np.float32)[:, None] for p in (points, guess))
    there, ok, _ = cv2.calcOpticalFlowPyrLK(before, after, start, first.copy(), **settings)
    back, ok_back, _ = cv2.calcOpticalFlowPyrLK(after, before, there, start.copy(), **settings)
    sure = (np.asarray(ok) > 0).ravel() & (np.asarray(ok_back) > 0).ravel()
    sure &= np.linalg.norm(back - start, axis=-1).ravel() < 0.5
    return np.where(sure[:, None], there[:, 0].astype(np.float64) + 0.5, np.nan)


def _spreads(track: Track, found: np.ndarray) -> np.ndarray:
    """(K,) pixels by which each point strays from a rigid head, measured after a first fit."""
    fitted = rigid_head.place(track, found, track.poses())
    away = np.linalg.norm(found - fitted.project(), axis=-1)
    return np.maximum(np.median(away, axis=0), 0.1)
