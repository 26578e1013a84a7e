"""Rotations as quaternions wxyz."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# (torch leaves some of its functions untyped)

import torch
from torch import Tensor


def to_matrix(quats: Tensor) -> Tensor:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4), which need not be normalised."""
    w, x, y, z = torch.nn.functional.normalize(quats, dim=-1).unbind(-1)
    rows = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    return torch.stack(rows, -1).unflatten(-1, (3, 3))  # (..., 3, 3)


def from_matrix(matrix: Tensor) -> Tensor:
    """Quaternion (4,) of one rotation matrix (3, 3).

    The quaternion is the eigenvector of the largest eigenvalue of a symmetric 4×4 matrix, a method
    without special cases (Bar-Itzhack).
    """
    m = matrix
    trace = m.diagonal().sum()
    skew = torch.stack([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])  # (3,)
    symmetric = m.new_zeros(4, 4)
    symmetric[0, 0] = trace
    symmetric[0, 1:] = symmetric[1:, 0] = skew
    symmetric[1:, 1:] = m + m.T - trace * torch.eye(3, dtype=m.dtype, device=m.device)
    return torch.linalg.eigh(symmetric).eigenvectors[:, -1]


def multiply(a: Tensor, b: Tensor) -> Tensor:
    """Hamilton product a·b of quaternions (..., 4): rotates first by b, then by a."""
    aw, ax, ay, az = a.unbind(-1)
    bw, bx, by, bz = b.unbind(-1)
    parts = [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
    return torch.stack(parts, -1)
