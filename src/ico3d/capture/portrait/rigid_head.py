"""Fits one rigid head to a whole clip: focal length, shape, and a pose for each frame.

This is a bundle adjustment over face landmarks. The head model that is trained on the result has
static geometry, so the poses must be those of the skull: landmarks that move with the expression
are recognised by their residuals and weighted down. Camera axes are OpenGL's (x right, y up, camera
looks along -z), as in the talking-portrait layout.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ico3d.common.spread import spread

FOCAL_GUESS = 2.3
"""Focal length of a usual portrait video, as a factor of the longer image side."""
FOCAL_SPREAD = 0.4
"""Standard deviation of the logarithm of `FOCAL_GUESS`."""
SHAPE_SPREAD = 0.004
"""Usual deviation of a person's landmarks from the canonical face, metres."""
INDEPENDENT = 20
"""Number of independent frames that a clip is worth, as landmark errors repeat over frames."""
FIT_FRAMES = 120
"""Number of frames on which shape and focal length are fitted; poses follow for all frames."""

ALL_FREEDOMS = (0, 1, 2, 3, 4, 5)
"""Degrees of freedom of a pose: rotations about the camera's axes, then translations along them."""
IN_PLANE = (2, 3, 4, 5)
"""Degrees that a flat face determines well: rotation in the image plane, position and size."""
CHUNK = 256
"""Number of frames whose poses are solved for at once."""


@dataclass(frozen=True)
class Track:
    """A tracked head in a portrait clip.

    Attributes:
        focal: Focal length in pixels.
        center: (2,) principal point in pixels.
        shape: (K, 3) the person's landmarks at rest in canonical head space, metres.
        rotations: (F, 3, 3) camera from head, OpenGL axes.
        translations: (F, 3) position of the head's origin in OpenGL camera axes, metres.
        sigmas: (K,) deviation of each landmark from the rigid head, pixels.
    """

    focal: float
    center: np.ndarray
    shape: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray
    sigmas: np.ndarray

    def project(self) -> np.ndarray:
        """(F, K, 2) the rigid landmarks of all frames in pixels."""
        return _project(self, _local(self))

    def poses(self) -> np.ndarray:
        """(F, 4, 4) camera from head, OpenGL axes, metres."""
        poses = np.tile(np.eye(4), (len(self.rotations), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = self.rotations, self.translations
        return poses

    def part(self, chosen: Sequence[int]) -> "Track":
        """The track through some of its frames."""
        places = np.asarray(chosen)
        return replace(
            self, rotations=self.rotations[places], translations=self.translations[places]
        )


def fit(
    landmarks: np.ndarray,
    start: np.ndarray,
    shape: np.ndarray,
    rigidity: np.ndarray,
    image_size: tuple[int, int],
    focal: float | None = None,
) -> Track:
    """Fits focal length, shape and poses to landmarks.

    Args:
        landmarks: (F, K, 2) pixels.
        start: (F, 4, 4) rough poses, camera from head (OpenGL axes, metres, any focal length).
        shape: (K, 3) the canonical face in metres.
        rigidity: (K,) initial trust in each landmark, in [0, 1].
        image_size: (width, height) in pixels.
        focal: Focal length in pixels, or None to estimate it.

    Returns:
        The track; its poses are as noisy as the landmarks (`picture_poses.align` refines them).
    """
    chosen = spread(len(landmarks), FIT_FRAMES)
    track = _start(start[chosen], shape, image_size, focal)
    track = replace(track, sigmas=1.0 / np.maximum(rigidity, 0.05))
    for _ in range(30):
        track = _pose_step(track, landmarks[chosen])
    for _ in range(3):
        track = _reweighted(track, landmarks[chosen])
        track = _alternate(track, landmarks[chosen], shape, 10)
        for factor in (1.25, 1.06) if focal is None else ():
            track = _focal_search(track, landmarks[chosen], shape, factor)
    first = _start(start, track.shape, image_size, track.focal).poses()
    return place(track, landmarks, first)


def place(
    track: Track,
    landmarks: np.ndarray,
    start: np.ndarray,
    freedoms: tuple[int, ...] = ALL_FREEDOMS,
) -> Track:
    """Fits poses to landmarks of any frames, with known shape and focal length.

    Args:
        track: Shape, focal length and weights.
        landmarks: (F, K, 2) pixels.
        start: (F, 4, 4) initial poses, camera from head.
        freedoms: Those of `ALL_FREEDOMS` to solve for; the others keep their initial values.
    """
    parts = [
        _placed(track, landmarks[first : first + CHUNK], start[first : first + CHUNK], freedoms)
        for first in range(0, len(landmarks), CHUNK)
    ]
    rotations = np.concatenate([part.rotations for part in parts])
    translations = np.concatenate([part.translations for part in parts])
    return replace(track, rotations=rotations, translations=translations)


def _placed(
    track: Track, landmarks: np.ndarray, start: np.ndarray, freedoms: tuple[int, ...]
) -> Track:
    """`place` for as many frames as fit into memory at once."""
    placed = replace(track, rotations=start[:, :3, :3], translations=start[:, :3, 3])
    for _ in range(12):
        placed = _pose_step(placed, landmarks, freedoms)
    return placed


def _start(start: np.ndarray, shape: np.ndarray, size: tuple, focal: float | None) -> Track:
    """A first track: rotations as they come, depths scaled to the focal length."""
    guessed = focal or FOCAL_GUESS * max(size)
    assumed = size[1] / 2 / np.tan(np.radians(63 / 2))  # what MediaPipe's own poses assume
    translations = start[:, :3, 3] * np.array([1.0, 1.0, guessed / assumed])
    center = np.array([size[0] / 2, size[1] / 2])
    return Track(guessed, center, shape, start[:, :3, :3], translations, np.ones(len(shape)))


def _local(track: Track) -> np.ndarray:
    """(F, K, 3) landmarks in camera axes."""
    return track.shape @ track.rotations.transpose(0, 2, 1) + track.translations[:, None]


def _project(track: Track, local: np.ndarray) -> np.ndarray:
    """(F, K, 2) pixels of points in camera axes."""
    x, y, z = np.moveaxis(local, -1, 0)
    return track.center + track.focal * np.stack([-x / z, y / z], -1)


def _jacobian(track: Track, local: np.ndarray) -> np.ndarray:
    """(F, K, 2, 3) derivative of pixels by points in camera axes."""
    x, y, z = np.moveaxis(local, -1, 0)
    zero = np.zeros_like(x)
    rows = [[-1 / z, zero, x / z**2], [zero, 1 / z, -y / z**2]]
    return track.focal * np.stack([np.stack(row, -1) for row in rows], -2)


def _weights(track: Track, residuals: np.ndarray) -> np.ndarray:
    """(F, K) Cauchy weights in units of each landmark's own spread."""
    normed = (residuals**2).sum(-1) / track.sigmas**2
    return 1.0 / track.sigmas**2 / (1.0 + normed / 9.0)


def _pose_step(
    track: Track, landmarks: np.ndarray, freedoms: tuple[int, ...] = ALL_FREEDOMS
) -> Track:
    """One Gauss-Newton step of all poses."""
    local = _local(track)  # (F, K, 3)
    residuals = landmarks - _project(track, local)  # (F, K, 2)
    by_point = _jacobian(track, local)  # (F, K, 2, 3)
    turned = local - track.translations[:, None]
    by_turn = np.cross(turned[..., None, :], by_point)  # (F, K, 2, 3): d(w x p) . J = w . (p x J)
    jacobian = np.concatenate([by_turn, by_point], -1)[..., freedoms]  # (F, K, 2, freedoms)
    weighted = jacobian * _weights(track, residuals)[..., None, None]
    normal, pull = _normal_equations(weighted, jacobian, residuals)
    normal += 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(len(freedoms))
    step = np.zeros((len(local), 6))
    step[:, freedoms] = np.linalg.solve(normal, pull)[..., 0]
    length = np.linalg.norm(step[:, :3], axis=1, keepdims=True)
    turn = step[:, :3] * np.minimum(1.0, 0.3 / np.maximum(length, 1e-12))
    rotations = Rotation.from_rotvec(turn).as_matrix() @ track.rotations
    translations = track.translations + step[:, 3:]
    translations[:, 2] = np.minimum(translations[:, 2], -0.05)  # in front of the camera
    return replace(track, rotations=rotations, translations=translations)


def _normal_equations(
    weighted: np.ndarray, jacobian: np.ndarray, residuals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(N, P, P) and (N, P, 1) of N independent problems from (N, M, 2, P) and (N, M, 2)."""
    count, unknowns = len(jacobian), jacobian.shape[-1]
    left = weighted.reshape(count, -1, unknowns).transpose(0, 2, 1)  # (N, P, 2M)
    right = left @ residuals.reshape(count, -1, 1)
    return left @ jacobian.reshape(count, -1, unknowns), right


def _shape_step(track: Track, landmarks: np.ndarray, canonical: np.ndarray) -> Track:
    """One Gauss-Newton step of the shape, held to the canonical face."""
    local = _local(track)
    residuals = landmarks - _project(track, local)
    by_shape = _jacobian(track, local) @ track.rotations[:, None]  # (F, K, 2, 3)
    share = min(1.0, INDEPENDENT / len(landmarks))
    weighted = by_shape * (share * _weights(track, residuals))[..., None, None]
    swapped = [np.swapaxes(part, 0, 1) for part in (weighted, by_shape, residuals)]
    normal, pull = _normal_equations(*swapped)
    normal += np.eye(3) / SHAPE_SPREAD**2
    pull += (canonical - track.shape)[..., None] / SHAPE_SPREAD**2
    step = np.linalg.solve(normal, pull)[..., 0]  # (K, 3)
    return replace(track, shape=track.shape + step)


def _reweighted(track: Track, landmarks: np.ndarray) -> Track:
    """Each landmark's spread, measured: robust standard deviation of its residuals over time."""
    residuals = landmarks - track.project()
    lengths = np.median(np.linalg.norm(residuals, axis=-1), axis=0)  # (K,)
    return replace(track, sigmas=np.maximum(lengths / 1.18, 0.3))


def _alternate(track: Track, landmarks: np.ndarray, canonical: np.ndarray, rounds: int) -> Track:
    """Shape and pose steps in turn."""
    for _ in range(rounds):
        track = _pose_step(_shape_step(track, landmarks, canonical), landmarks)
    return track


def _focal_search(
    track: Track, landmarks: np.ndarray, canonical: np.ndarray, factor: float
) -> Track:
    """Walks the focal length up or down by `factor` while the cost falls."""
    best, cost = track, _cost(track, landmarks, canonical)
    for ratio in (factor, 1 / factor):
        for _ in range(8):
            moved = _alternate(_refocused(best, ratio), landmarks, canonical, 4)
            moved_cost = _cost(moved, landmarks, canonical)
            if moved_cost >= cost:
                break
            best, cost = moved, moved_cost
    return best


def _refocused(track: Track, ratio: float) -> Track:
    """The same pictures through a lens of another focal length: the head moves along."""
    translations = track.translations * np.array([1.0, 1.0, ratio])
    return replace(track, focal=track.focal * ratio, translations=translations)


def _cost(track: Track, landmarks: np.ndarray, canonical: np.ndarray) -> float:
    """Minus the logarithm of the posterior, up to a constant."""
    residuals = landmarks - track.project()
    normed = (residuals**2).sum(-1) / track.sigmas**2
    share = min(1.0, INDEPENDENT / len(landmarks))
    data = share * 4.5 * np.log1p(normed / 9.0).sum()
    shape = 0.5 * ((track.shape - canonical) ** 2).sum() / SHAPE_SPREAD**2
    guess = FOCAL_GUESS * 2 * track.center.max()
    lens = 0.5 * (np.log(track.focal / guess) / FOCAL_SPREAD) ** 2
    # Neighbouring landmarks err together, some thirty groups of them on a face.
    return float((data + shape) * 30 / len(canonical) + lens)
