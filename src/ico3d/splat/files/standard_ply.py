"""The PLY layout of the original 3D Gaussian Splatting code: one row of floats per Gaussian."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ico3d.errors import GaussianFileError
from ico3d.splat.files.ply import columns
from ico3d.splat.files.raw import PROPERTIES, RawGaussians, rest_properties

_DEGREES = {len(rest_properties(degree)): degree for degree in range(4)}


def read(table: NDArray[Any]) -> RawGaussians:
    """Gaussians from a PLY file's vertex table (N,); column order is free, extra ones are ignored.

    Raises:
        GaussianFileError: If a column is missing or there are harmonics above degree 3.
    """
    present = table.dtype.names or ()
    for name in (n for field, names in PROPERTIES.items() if field != "normals" for n in names):
        if name not in present:
            raise GaussianFileError(f"the PLY holds no 3D Gaussians: it lacks the property {name}")
    rest = sum(name.startswith("f_rest_") for name in present)
    if rest not in _DEGREES or not set(rest_properties(_DEGREES[rest])) <= set(present):
        raise GaussianFileError(f"{rest} properties f_rest_*: expected f_rest_0 to 8, 23 or 44")
    fields = {
        field: columns(table, names)
        for field, names in PROPERTIES.items()
        if set(names) <= set(present)
    }
    channels = columns(table, rest_properties(_DEGREES[rest]))  # (N, 3·(K - 1))
    return RawGaussians(
        **(fields | {"opacities": fields["opacities"][:, 0]}),
        rest=by_coefficient(channels),
    )


def by_coefficient(channels: NDArray[Any]) -> NDArray[Any]:
    """Harmonics (N, K - 1, 3) from columns (N, 3·(K - 1)) that hold red, then green, then blue."""
    per_channel = channels.shape[1] // 3
    return channels.reshape(len(channels), 3, per_channel).transpose(0, 2, 1)


def header(count: int, degree: int) -> bytes:
    """The PLY header that the original code writes, for `count` Gaussians."""
    return "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {count}",
            *(f"property float {name}" for name in property_order(degree)),
            "end_header\n",
        ]
    ).encode()


def property_order(degree: int) -> list[str]:
    """Names of all columns, in the order of the original code."""
    before, after = ("means", "normals", "dc"), ("opacities", "log_scales", "quats")
    return [
        *(name for field in before for name in PROPERTIES[field]),
        *rest_properties(degree),
        *(name for field in after for name in PROPERTIES[field]),
    ]


def write(gaussians: RawGaussians, path: Path) -> None:
    """Writes a PLY file; missing normals are written as 0, as in the original code."""
    count = len(gaussians)
    normals = np.zeros((count, 3), np.float32) if gaussians.normals is None else gaussians.normals
    parts = [
        *(gaussians.means, normals, gaussians.dc),
        gaussians.rest.transpose(0, 2, 1).reshape(count, 3 * gaussians.rest.shape[1]),
        *(gaussians.opacities[:, None], gaussians.log_scales, gaussians.quats),
    ]
    rows = np.concatenate(parts, 1, dtype="<f4")  # (N, 17 + 3·(K - 1))
    with path.open("wb") as file:
        file.write(header(count, gaussians.degree))
        file.write(rows.data)
