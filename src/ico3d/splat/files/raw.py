"""Gaussians as files store them: without activation functions, so copying loses nothing."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ico3d.errors import GaussianFileError, SettingsError
from ico3d.splat import harmonics
from ico3d.splat.gaussians import Gaussians

Floats = NDArray[np.float32]

OPACITY_MARGIN = 1e-6
"""Opacities are kept this far from 0 and 1, whose logits are infinite."""

MAX_LOG_SCALE = 88.0
"""Largest logarithm whose exp() does not overflow float32."""

PROPERTIES = {
    "means": ("x", "y", "z"),
    "normals": ("nx", "ny", "nz"),
    "dc": ("f_dc_0", "f_dc_1", "f_dc_2"),
    "opacities": ("opacity",),
    "log_scales": ("scale_0", "scale_1", "scale_2"),
    "quats": ("rot_0", "rot_1", "rot_2", "rot_3"),
}
"""What 3DGS files call the columns of each field; `rest_properties` names the others."""

_HALF_TURN_SH = np.array([-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], np.float32)
"""What turning by 180° about x does to the harmonics of degrees 1 to 3: y and z change sign."""


def rest_properties(degree: int) -> list[str]:
    """Column names in 3DGS files of harmonics above degree 0: all of red, then green, then blue."""
    return [f"f_rest_{index}" for index in range(3 * ((degree + 1) ** 2 - 1))]


@dataclass(frozen=True)
class RawGaussians:
    """N Gaussians with the unactivated float32 parameters of 3DGS files.

    Attributes:
        means: (N, 3) positions in the axes of PLY files, by convention x right, y down, z forward
            (RDF).
        dc: (N, 3) coefficients of the spherical harmonic of degree 0.
        rest: (N, K - 1, 3) coefficients of the higher degrees, K = (degree + 1)².
        opacities: (N,) logits.
        log_scales: (N, 3) natural logarithms of the standard deviations.
        quats: (N, 4) rotations wxyz, not normalised.
        normals: (N, 3), which some files hold although nothing uses them, or None.
    """

    means: Floats
    dc: Floats
    rest: Floats
    opacities: Floats
    log_scales: Floats
    quats: Floats
    normals: Floats | None = None

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.means)

    @property
    def nbytes(self) -> int:
        """Bytes of all parameters."""
        return sum(part.nbytes for part in vars(self).values() if part is not None)

    @property
    def degree(self) -> int:
        """The degree of the spherical harmonics, 0 to 3."""
        return harmonics.degree_of(self.rest.shape[1] + 1)

    @staticmethod
    def from_gaussians(gaussians: Gaussians) -> "RawGaussians":
        """Raw parameters of activated Gaussians; opacities are kept away from 0 and 1."""
        parts = gaussians.detach().to("cpu").map(lambda tensor: tensor.float())
        if parts.sh is not None:
            sh = parts.sh.numpy()  # (N, K, 3)
        else:
            assert parts.colors is not None
            sh = dc_of_colors(parts.colors.numpy())[:, None]  # (N, 1, 3)
        return RawGaussians(
            means=parts.means.numpy(),
            dc=sh[:, 0],
            rest=sh[:, 1:],
            opacities=logits(parts.opacities.numpy()),
            log_scales=logarithms(parts.scales.numpy()),
            quats=parts.quats.numpy(),
        )

    def to_gaussians(self) -> Gaussians:
        """Activated Gaussians, ready to render; colours are given as harmonics at every degree."""
        sh = np.concatenate([self.dc[:, None], self.rest], 1)  # (N, K, 3)
        return Gaussians(
            means=torch.tensor(self.means),
            quats=torch.tensor(self.quats),
            scales=torch.tensor(self.log_scales).exp(),
            opacities=torch.tensor(self.opacities).sigmoid(),
            sh=torch.tensor(sh),
        )

    def with_degree(self, degree: int) -> "RawGaussians":
        """The same Gaussians without harmonics above `degree`.

        Raises:
            SettingsError: If the Gaussians have a lower degree than asked for.
        """
        if degree > self.degree:
            raise SettingsError(
                f"SH degree {degree} was asked for, but the Gaussians have {self.degree} only: "
                "ask for that or less."
            )
        return replace(self, rest=self.rest[:, : (degree + 1) ** 2 - 1])

    def half_turn(self) -> "RawGaussians":
        """The Gaussians turned by 180° about x, losslessly.

        RDF axes (x right, y down, z forward) become RUB (x right, y up, z backward) and vice versa.
        """
        moved = ("means", "rest", "quats", "normals")
        copies = {name: np.copy(v) for name in moved if (v := getattr(self, name)) is not None}
        turned = replace(self, **copies)
        half_turn_in_place(turned)
        return turned

    def checked(self) -> "RawGaussians":
        """Returns these Gaussians after checking them.

        Raises:
            GaussianFileError: If a value is not finite once activated; the sentence names the first
                one.
        """
        bad = [found for found in map(self._first_bad, (*PROPERTIES, "rest")) if found]
        if bad:
            index, name, value = min(bad)
            raise GaussianFileError(f"Gaussian {index} has the {name} {value}: expected a number")
        return self

    def _first_bad(self, field: str) -> tuple[int, str, float] | None:
        """Index, property name and value of the first value of a field nobody can render."""
        values = getattr(self, field)
        if values is None:
            return None
        good = _renderable(field, values)
        if good.all():
            return None
        index = int(np.argmin(good.reshape(len(values), -1).all(1)))
        where = tuple(int(i) for i in np.argwhere(~good[index])[0])
        return index, _property_name(field, where, self.rest.shape[1]), float(values[index][where])


def half_turn_in_place(gaussians: RawGaussians) -> None:
    """Like `RawGaussians.half_turn`, but overwrites the arrays."""
    flip = np.array([1, -1, -1], np.float32)
    np.multiply(gaussians.means, flip, out=gaussians.means)
    if gaussians.normals is not None:
        np.multiply(gaussians.normals, flip, out=gaussians.normals)
    # D·R·D instead of D·R: the axes of an ellipsoid have no sign.
    gaussians.quats[:, 2:] *= -1
    signs = _HALF_TURN_SH[: gaussians.rest.shape[1], None]  # (K - 1, 1)
    np.multiply(gaussians.rest, signs, out=gaussians.rest)


def _renderable(field: str, values: Floats) -> NDArray[np.bool_]:
    """Which values of a field mean something: those that activate to finite numbers.

    Other tools do write infinite logits for opacities of 0 and 1, and -inf for flat scales.
    """
    if field == "opacities":
        return ~np.isnan(values)
    if field == "log_scales":
        return values < MAX_LOG_SCALE
    return np.isfinite(values)


def _property_name(field: str, where: tuple[int, ...], per_channel: int) -> str:
    """What files call one value of a field, at `where` in a Gaussian's part of the array."""
    if field == "rest":
        return f"f_rest_{where[1] * per_channel + where[0]}"
    return PROPERTIES[field][where[0] if where else 0]


def logits(opacities: NDArray[Any]) -> Floats:
    """Logits of opacities in [0, 1], of any shape; opacities are kept away from 0 and 1."""
    inside = np.clip(opacities, OPACITY_MARGIN, 1 - OPACITY_MARGIN, dtype=np.float64)
    return np.log(inside / (1 - inside)).astype(np.float32)


def logarithms(scales: NDArray[Any]) -> Floats:
    """Logarithms of standard deviations, any shape; 0 is taken as the smallest normal float32."""
    return np.log(np.maximum(scales, np.finfo(np.float32).tiny)).astype(np.float32)


def dc_of_colors(colors: NDArray[Any]) -> Floats:
    """Coefficients (N, 3) of the harmonic of degree 0 for colours (N, 3) in [0, 1]."""
    return ((colors - 0.5) / harmonics.C0).astype(np.float32)
