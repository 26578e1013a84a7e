"""The `.splat` files of antimatter15's viewer: 32 bytes per Gaussian, no header."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ico3d.errors import GaussianFileError
from ico3d.splat.files.raw import RawGaussians, dc_of_colors, logarithms, logits

_ROW = np.dtype([("means", "<f4", 3), ("scales", "<f4", 3), ("rgba", "u1", 4), ("quats", "u1", 4)])
_NORM_ERROR = 0.03
"""Bytes of a unit quaternion are off by at most 1/128 each, so its length by 2/128 and some."""


def looks_like(data: bytes, size: int) -> bool:
    """Whether a file that begins with `data` and has `size` bytes may be a `.splat` file.

    The test is whether rotations are unit quaternions; random bytes pass in one of 14 rows.
    """
    rows = np.frombuffer(data, _ROW, len(data) // _ROW.itemsize)[:64]
    if size % _ROW.itemsize or not len(rows):
        return False
    norms = np.linalg.norm(_quats(rows), axis=1)
    positive = np.isfinite(rows["scales"]).all() and (rows["scales"] >= 0).all()
    return bool(
        positive and np.isfinite(rows["means"]).all() and (abs(norms - 1) < _NORM_ERROR).all()
    )


def _quats(rows: NDArray[Any]) -> NDArray[Any]:
    """Quaternions wxyz (n, 4) of rows (n,)."""
    return (rows["quats"].astype(np.float32) - 128) / 128


def read(data: bytes) -> RawGaussians:
    """Decodes the Gaussians of a `.splat` file.

    Raises:
        GaussianFileError: If the file is empty or ends within a Gaussian, or a scale is negative.
    """
    if not data:
        raise GaussianFileError("a .splat file without a byte")
    if len(data) % _ROW.itemsize:
        raise GaussianFileError(
            f"a .splat file of {len(data)} bytes ends within the Gaussian at byte "
            f"{len(data) - len(data) % _ROW.itemsize}: it is cut off or damaged"
        )
    rows = np.frombuffer(data, _ROW)
    negative = (rows["scales"] < 0).any(1)
    if negative.any():
        index = int(np.argmax(negative))
        raise GaussianFileError(
            f"Gaussian {index}, at byte {index * _ROW.itemsize}, has a scale below 0"
        )
    colors = rows["rgba"].astype(np.float32) / 255  # (N, 4)
    return RawGaussians(
        means=rows["means"].astype(np.float32),
        dc=dc_of_colors(colors[:, :3]),
        rest=np.empty((len(rows), 0, 3), np.float32),
        opacities=logits(colors[:, 3]),
        log_scales=logarithms(rows["scales"]),
        quats=_quats(rows),
    )
