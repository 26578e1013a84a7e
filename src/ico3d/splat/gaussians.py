"""The Gaussian primitive: activated parameters, ready to render."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false
# (torch leaves some of its functions untyped)

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from torch import Tensor

from ico3d.splat import harmonics, quaternions


@dataclass
class Gaussians:
    """N anisotropic 3D Gaussians with activated parameters.

    Attributes:
        means: (N, 3) metres.
        quats: (N, 4) rotations wxyz; need not be normalised.
        scales: (N, 3) standard deviations in metres, positive.
        opacities: (N,) in [0, 1].
        colors: (N, 3) RGB, or None where `sh` is given.
        sh: (N, K, 3) spherical harmonics, K = (degree + 1)², or None.
    """

    means: Tensor
    quats: Tensor
    scales: Tensor
    opacities: Tensor
    colors: Tensor | None = None
    sh: Tensor | None = None

    def __len__(self) -> int:
        """The number of Gaussians."""
        return self.means.shape[0]

    def map(self, change: Callable[[Tensor], Tensor]) -> "Gaussians":
        """Gaussians with `change` applied to every tensor."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        present = {name: change(value) for name, value in values.items() if value is not None}
        return Gaussians(**present)

    def to(self, device: torch.device | str) -> "Gaussians":
        """The same Gaussians on another device."""
        return self.map(lambda tensor: tensor.to(device))

    def detach(self) -> "Gaussians":
        """The same Gaussians, detached from autograd."""
        return self.map(Tensor.detach)

    def __getitem__(self, index: Tensor | slice) -> "Gaussians":
        """Those that a mask, an index tensor or a slice selects."""
        return self.map(lambda tensor: tensor[index])

    def painted(self, colors: Tensor) -> "Gaussians":
        """The same Gaussians with other colours (N, 3), which look alike from everywhere."""
        return replace(self, colors=colors, sh=None)

    def up_to_degree(self, degree: int) -> "Gaussians":
        """Without harmonics above a degree; the same Gaussians where there are none."""
        if self.sh is None:
            return self
        return replace(self, sh=self.sh[:, : (degree + 1) ** 2])  # (N, K', 3)

    def drawable(self) -> Tensor:
        """(N,) bool: whether all parameters are finite and the quaternion is not 0."""
        values = [getattr(self, field.name) for field in fields(self)]
        present = [value for value in values if value is not None]
        turns = self.quats.any(1)  # (N,)
        if torch.stack([value.sum() for value in present]).isfinite().all():  # quick to find out
            return turns
        finite = [v.isfinite().flatten(1).all(1) for v in present if v.dim() > 1]
        return torch.stack([*finite, self.opacities.isfinite(), turns]).all(0)

    def where(self, chosen: Tensor, others: "Gaussians") -> "Gaussians":
        """These Gaussians where `chosen` (N,) is true, else `others`, with the same fields."""
        values = {}
        for field in fields(self):
            a, b = getattr(self, field.name), getattr(others, field.name)
            if a is not None:
                shaped = chosen.view(-1, *[1] * (a.dim() - 1))  # (N, 1, …)
                values[field.name] = torch.where(shaped, a, b)
        return Gaussians(**values)

    def transform(self, a_from_b: Tensor | np.ndarray) -> "Gaussians":
        """Moves Gaussians from space b to space a.

        Args:
            a_from_b: (4, 4) similarity: rotation, uniform scale, translation. A tensor may require
                gradients, which then flow through means and scales.

        Returns:
            Gaussians with moved means, rotations, scales and harmonics; other tensors are shared.

        Raises:
            ValueError: If the matrix is no similarity, or contains a reflection.
        """
        matrix = torch.as_tensor(a_from_b).to(self.means)
        scale, rotation = _split_similarity(matrix)
        turn = quaternions.from_matrix(rotation.detach().double()).to(self.quats)  # (4,)
        return Gaussians(
            self.means @ matrix[:3, :3].T + matrix[:3, 3],  # (N, 3)
            quaternions.multiply(turn, self.quats),  # (N, 4)
            self.scales * scale,  # (N, 3)
            self.opacities,
            self.colors,
            None if self.sh is None else harmonics.rotate(self.sh, rotation),  # (N, K, 3)
        )


def _split_similarity(matrix: Tensor) -> tuple[Tensor, Tensor]:
    """Scale () and rotation (3, 3) of a similarity.

    Raises:
        ValueError: If it is none, or mirrors.
    """
    linear = matrix[:3, :3]
    determinant = torch.linalg.det(linear.double())
    if not determinant > 0:
        raise ValueError("a_from_b mirrors or flattens: expected a similarity")
    scale = determinant.pow(1 / 3).to(matrix)
    rotation = linear / scale
    error = rotation @ rotation.T - torch.eye(3, dtype=matrix.dtype, device=matrix.device)
    if error.abs().max() > 1e-3:
        raise ValueError("a_from_b shears or scales unevenly: expected a similarity")
    return scale, rotation


def cat(parts: Sequence[Gaussians]) -> Gaussians:
    """Concatenates several sets of Gaussians; if any has harmonics, all have of the highest degree.

    Harmonics that a set lacks are 0, so it looks as before.
    """
    most = max(0 if part.sh is None else part.sh.shape[1] for part in parts)
    if most:
        parts = [_with_harmonics(part, most) for part in parts]
    values: dict[str, Tensor] = {}
    for field in fields(Gaussians):
        tensors = [getattr(part, field.name) for part in parts]
        if tensors[0] is not None:
            values[field.name] = torch.cat(tensors)
    return Gaussians(**values)


def _with_harmonics(part: Gaussians, count: int) -> Gaussians:
    """The same Gaussians with `count` coefficients of harmonics."""
    sh = part.sh
    if sh is None:
        assert part.colors is not None
        sh = harmonics.of_colors(part.colors)  # (N, 1, 3)
    missing = sh.new_zeros(len(part), count - sh.shape[1], 3)
    return replace(part, colors=None, sh=torch.cat([sh, missing], 1))  # (N, K, 3)
