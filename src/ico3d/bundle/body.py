"""One window of the baked body: its file and its evaluation (docs/bundle.md, body/0000 …)."""

from dataclasses import dataclass, fields

import numpy as np

from ico3d.bundle.manifest import BodyInfo, WindowInfo
from ico3d.bundle.tensors import Spec, decode_tensors, encode_tensors
from ico3d.errors import BundleError

QUAT_UNIT = 32767
"""What stands for 1 in `quats`."""
_MAX_LENGTH = 1e4
"""Metres; anything farther is no person, and overflows when it is squared in a shader."""
_MAX_LOG_SCALE = 20.0


@dataclass(frozen=True)
class BakedWindow:
    """N Gaussians in the world whose place, rotation and size move in a few shared ways.

    Attributes:
        means: (N, 3) float32 metres.
        quats: (N, 4) int16 wxyz in units of 1/32767, of any length up to 1.
        scales: (N, 3) float16, logarithms of metres.
        rgba: (N, 4) uint8 display colour and opacity.
        units: (N, 3) float16 in [0, 1], what 1 stands for in a Gaussian's three bases.
        position_basis: (P, N, 3) int8.
        rotation_basis: (R, N, 4) int8.
        scale_basis: (L, N, 3) int8.
        coefficients: (S, P + R + L) float32: metres, quaternion values and logarithms per unit of
            basis · unit, at S times evenly spread over the window.
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    rgba: np.ndarray
    units: np.ndarray
    position_basis: np.ndarray
    rotation_basis: np.ndarray
    scale_basis: np.ndarray
    coefficients: np.ndarray

    @property
    def num_gaussians(self) -> int:
        """N."""
        return self.means.shape[0]

    @property
    def ranks(self) -> tuple[int, int, int]:
        """P, R, L."""
        return len(self.position_basis), len(self.rotation_basis), len(self.scale_basis)

    def to_bytes(self, name: str) -> bytes:
        """The content of the file `name`.

        Raises:
            BundleError: If shapes or dtypes disagree, or a value is out of range.
        """
        tensors = {f.name: getattr(self, f.name) for f in fields(self)}
        spec = _window_spec(self.num_gaussians, self.ranks, len(self.coefficients))
        data = encode_tensors(tensors, spec, name)
        _check_reach(self, name)
        return data

    @staticmethod
    def from_bytes(data: bytes, body: BodyInfo, window: WindowInfo) -> "BakedWindow":
        """Reads a window; the counts must be those of the manifest.

        Raises:
            BundleError: If anything does not fit.
        """
        spec = _window_spec(window.num_gaussians, window.ranks, body.num_samples(window))
        baked = BakedWindow(**decode_tensors(data, spec, window.file))
        _check_reach(baked, window.file)
        return baked

    def coefficients_at(self, tau: float) -> np.ndarray:
        """(P + R + L,) float32 at τ in [0, 1]: Catmull–Rom between the sampled times.

        Beyond either end the samples go on as the parabola through the last three, so that the
        curve is quadratic there too.
        """
        rows = _continued(self.coefficients)  # (S + 2, P + R + L)
        place = min(max(tau, 0.0), 1.0) * (len(rows) - 3)
        index = min(int(place), len(rows) - 4)
        return _catmull_rom(np.float32(place - index)) @ rows[index : index + 4]

    def at(self, tau: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What moves, at τ in [0, 1].

        Returns:
            means (N, 3) in metres, quats (N, 4) wxyz normalised, scales (N, 3) in metres; float32.
        """
        p, r, _ = self.ranks
        c = self.coefficients_at(tau)
        units = self.units.astype(np.float32)
        means = self.means + units[:, :1] * _blend(c[:p], self.position_basis)
        turned = units[:, 1:2] * _blend(c[p : p + r], self.rotation_basis)  # (N, 4)
        quats = self.quats / np.float32(QUAT_UNIT) + turned
        quats /= np.maximum(np.linalg.norm(quats, axis=1, keepdims=True), np.float32(1e-6))
        scales = self.scales.astype(np.float32) + units[:, 2:] * _blend(
            c[p + r :], self.scale_basis
        )
        return means, quats, np.exp(scales)


def _continued(rows: np.ndarray) -> np.ndarray:
    """(S, K) → (S + 2, K): one more sample before and after, S ≥ 3."""
    before = 3 * rows[0] - 3 * rows[1] + rows[2]
    after = 3 * rows[-1] - 3 * rows[-2] + rows[-3]
    return np.vstack([before, rows, after])


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
    """Σ_k c_k · basis_k of (K, N, D) → (N, D) float32."""
    return np.tensordot(coefficients, basis.astype(np.float32), 1)


def _window_spec(n: int, ranks: tuple[int, int, int], samples: int) -> Spec:
    p, r, s = ranks
    return {
        "means": ("F32", (n, 3)),
        "quats": ("I16", (n, 4)),
        "scales": ("F16", (n, 3)),
        "rgba": ("U8", (n, 4)),
        "units": ("F16", (n, 3)),
        "position_basis": ("I8", (p, n, 3)),
        "rotation_basis": ("I8", (r, n, 4)),
        "scale_basis": ("I8", (s, n, 3)),
        "coefficients": ("F32", (samples, p + r + s)),
    }


def _check_reach(window: BakedWindow, name: str) -> None:
    """Bounds what can come out at any time, without evaluating."""
    p, r, _ = window.ranks
    rows = _continued(window.coefficients.astype(np.float64))
    most = 1.25 * np.abs(rows).max(axis=0)  # Catmull–Rom overshoots by a quarter at most
    units = window.units.astype(np.float64).T  # (3, N)
    if units.min() < 0 or units.max() > 1:
        raise BundleError(f"{name}: its units lie outside of 0 to 1.")
    places = np.abs(window.means).max(1) + _most(most[:p], window.position_basis, units[0])
    if places.max() > _MAX_LENGTH:
        raise BundleError(f"{name}: it reaches farther than {_MAX_LENGTH:g} m.")
    if _most(most[p : p + r], window.rotation_basis, units[1]).max() > _MAX_LENGTH:
        raise BundleError(f"{name}: its rotations are out of range.")
    sizes = window.scales.max(1) + _most(most[p + r :], window.scale_basis, units[2])
    if sizes.max() > _MAX_LOG_SCALE:
        raise BundleError(f"{name}: its Gaussians grow beyond exp({_MAX_LOG_SCALE:g}) m.")


def _most(coefficients: np.ndarray, basis: np.ndarray, units: np.ndarray) -> np.ndarray:
    """(N,) what the basis (K, N, D) adds to a Gaussian at most, units (N,) included."""
    return units * (coefficients @ np.abs(basis.astype(np.float64)).max(axis=2))
