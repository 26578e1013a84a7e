"""One window of the baked body: its file and its evaluation (docs/bundle.md, body/0000 …)."""

from dataclasses import dataclass, fields

import numpy as np

from ico3d.bundle.tensors import QUAT_UNIT, Spec, decode_tensors, encode_tensors
from ico3d.bundle.windows.info import BodyInfo, WindowInfo
from ico3d.errors import BundleError

_MAX_LENGTH = 1e4
"""Metres; anything farther is no person, and overflows when it is squared in a shader."""
LEAST_SCALE = 1e-6
"""Smallest standard deviation that is drawn, metres."""


@dataclass(frozen=True)
class BakedWindow:
    """N Gaussians in the world, in C clusters; each cluster moves by a few coefficients over time.

    Attributes:
        means: (N, 3) float32 metres.
        quats: (N, 4) int16 wxyz in units of 1/32767, of any length up to 1.
        scales: (N, 3) float16 standard deviations in metres.
        rgba: (N, 4) uint8 display colour and opacity.
        clusters: (N,) uint8, index of each Gaussian's cluster.
        position_basis: (P, N, 3) int16 basis vectors of positions.
        rotation_basis: (R, N, 4) int16 basis vectors of quaternions.
        scale_basis: (L, N, 3) int16 basis vectors of scales.
        coefficients: (S, C, P + R + L) float32 factors of the bases at S times, evenly spread over
            the window; one unit of a basis is worth that many metres, quaternion values or metres.
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    rgba: np.ndarray
    clusters: np.ndarray
    position_basis: np.ndarray
    rotation_basis: np.ndarray
    scale_basis: np.ndarray
    coefficients: np.ndarray

    @property
    def num_gaussians(self) -> int:
        """N, the number of Gaussians."""
        return self.means.shape[0]

    @property
    def num_clusters(self) -> int:
        """C, the number of clusters."""
        return self.coefficients.shape[1]

    @property
    def ranks(self) -> tuple[int, int, int]:
        """P, R, L, the numbers of basis vectors of positions, rotations and scales."""
        return len(self.position_basis), len(self.rotation_basis), len(self.scale_basis)

    def to_bytes(self, name: str) -> bytes:
        """The content of the file `name`.

        Raises:
            BundleError: If shapes or dtypes do not fit one another, or a value is out of range.
        """
        tensors = {f.name: getattr(self, f.name) for f in fields(self)}
        samples = len(self.coefficients)
        spec = _window_spec(self.num_gaussians, self.num_clusters, self.ranks, samples)
        data = encode_tensors(tensors, spec, name)
        _check_values(self, name)
        return data

    @staticmethod
    def from_bytes(data: bytes, body: BodyInfo, window: WindowInfo) -> "BakedWindow":
        """Reads a window and checks it against the manifest's counts.

        Raises:
            BundleError: If the file is malformed or does not fit the manifest.
        """
        samples = body.num_samples(window)
        spec = _window_spec(window.num_gaussians, window.num_clusters, window.ranks, samples)
        baked = BakedWindow(**decode_tensors(data, spec, window.file))
        _check_values(baked, window.file)
        return baked

    def coefficients_at(self, tau: float) -> np.ndarray:
        """(C, P + R + L) float32 at τ in [0, 1] of the window: Catmull–Rom between the samples.

        Before the first and after the last sample, the parabola through the three nearest samples
        is used, which makes the curve quadratic there.
        """
        rows = _continued(self.coefficients)  # (S + 2, C, P + R + L)
        place = min(max(tau, 0.0), 1.0) * (len(rows) - 3)
        index = min(int(place), len(rows) - 4)
        weights = _catmull_rom(np.float32(place - index))
        return np.tensordot(weights, rows[index : index + 4], 1)

    def at(self, tau: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The moving parts of the Gaussians at τ in [0, 1] of the window.

        Returns:
            means (N, 3) in metres, quats (N, 4) wxyz normalised, scales (N, 3) in metres; float32.
        """
        p, r, _ = self.ranks
        c = self.coefficients_at(tau)[self.clusters]  # (N, P + R + L)
        means = self.means + _blend(c[:, :p], self.position_basis)
        turned = _blend(c[:, p : p + r], self.rotation_basis)
        quats = self.quats / np.float32(QUAT_UNIT) + turned
        quats /= np.maximum(np.linalg.norm(quats, axis=1, keepdims=True), np.float32(1e-6))
        scales = self.scales.astype(np.float32) + _blend(c[:, p + r :], self.scale_basis)
        return means, quats, np.maximum(scales, np.float32(LEAST_SCALE))


def _continued(rows: np.ndarray) -> np.ndarray:
    """(S, …) → (S + 2, …): one more sample before and after, S ≥ 3."""
    before = 3 * rows[0] - 3 * rows[1] + rows[2]
    after = 3 * rows[-1] - 3 * rows[-2] + rows[-3]
    return np.concatenate([before[None], rows, after[None]])


def _catmull_rom(x: np.float32) -> np.ndarray:
    """(4,) weights of the samples before, at, after and after that, x in [0, 1] between two."""
    return np.array(
        [
            ((2 - x) * x - 1) * x / 2,
            ((3 * x - 5) * x * x + 2) / 2,
            ((4 - 3 * x) * x + 1) * x / 2,
            (x - 1) * x * x / 2,
        ],
        np.float32,
    )


def _blend(coefficients: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Σ_k c_nk · basis_kn of (N, K) and (K, N, D) → (N, D) float32."""
    return np.einsum("nk,knd->nd", coefficients, basis.astype(np.float32))


def _window_spec(n: int, clusters: int, ranks: tuple[int, int, int], samples: int) -> Spec:
    p, r, s = ranks
    return {
        "means": ("F32", (n, 3)),
        "quats": ("I16", (n, 4)),
        "scales": ("F16", (n, 3)),
        "rgba": ("U8", (n, 4)),
        "clusters": ("U8", (n,)),
        "position_basis": ("I16", (p, n, 3)),
        "rotation_basis": ("I16", (r, n, 4)),
        "scale_basis": ("I16", (s, n, 3)),
        "coefficients": ("F32", (samples, clusters, p + r + s)),
    }


def _check_values(window: BakedWindow, name: str) -> None:
    """Bounds what can come out at any time, without evaluating."""
    if window.clusters.max() >= window.num_clusters:
        raise BundleError(f"{name}: 'clusters' names one that is not there.")
    p, r, _ = window.ranks
    most = 1.25 * _largest(window.coefficients)  # Catmull–Rom overshoots by a quarter at most
    of, most = window.clusters, most.T  # (P + R + L, C)
    places = np.abs(window.means).max(axis=1) + _reach(most[:p], of, window.position_basis)
    if places.max() > _MAX_LENGTH:
        raise BundleError(f"{name}: it reaches farther than {_MAX_LENGTH:g} m.")
    if _reach(most[p : p + r], of, window.rotation_basis).max() > _MAX_LENGTH:
        raise BundleError(f"{name}: its rotations are out of range.")
    sizes = np.abs(window.scales).max(axis=1) + _reach(most[p + r :], of, window.scale_basis)
    if sizes.max() > _MAX_LENGTH:
        raise BundleError(f"{name}: its Gaussians grow beyond {_MAX_LENGTH:g} m.")


def _largest(coefficients: np.ndarray) -> np.ndarray:
    """(C, K) float64 the largest sizes of coefficients (S, C, K), continued at both ends.

    They may be hundreds of megabytes, so no copy is made of all of them.
    """
    before = _continued(coefficients[:3].astype(np.float64))[0]
    after = _continued(coefficients[-3:].astype(np.float64))[-1]
    sizes = np.maximum(coefficients.max(axis=0), -coefficients.min(axis=0))  # (C, K)
    return np.maximum(np.maximum(np.abs(before), np.abs(after)), sizes)


def _reach(most: np.ndarray, clusters: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Σ_k most_kc · |basis_kn|, the largest of D, for n of cluster c: (N,) of (K, C), (K, N, D)."""
    reach = np.zeros(len(clusters))
    for values, part in zip(most, basis, strict=True):
        sizes = np.maximum(
            part.max(axis=1).astype(np.float64), -part.min(axis=1).astype(np.float64)
        )
        reach += values[clusters] * sizes
    return reach
