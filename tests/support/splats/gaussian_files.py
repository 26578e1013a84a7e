"""What the tests of Gaussian files share."""

import struct
import warnings
from pathlib import Path

import numpy as np

from ico3d.splat.files import standard_ply
from ico3d.splat.files.raw import RawGaussians

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import gsply


def random_gaussians(count, degree, seed=0):
    """Gaussians of every kind of value: unnormalised, far, flat, nearly transparent."""
    random = np.random.default_rng(seed)

    def normal(*shape):
        return random.normal(size=shape).astype(np.float32)

    return RawGaussians(
        means=normal(count, 3) * 3,
        dc=normal(count, 3),
        rest=normal(count, (degree + 1) ** 2 - 1, 3) * np.float32(0.2),
        opacities=normal(count) * 4,
        log_scales=normal(count, 3) - 5,
        quats=normal(count, 4) * 2,
        normals=normal(count, 3),
    )


def as_gsply(gaussians):
    """The same Gaussians for the library that serves as a second opinion."""
    return gsply.GSData.from_arrays(
        means=gaussians.means,
        scales=gaussians.log_scales,
        quats=gaussians.quats,
        opacities=gaussians.opacities,
        sh0=gaussians.dc,
        shN=np.ascontiguousarray(gaussians.rest) if gaussians.degree else None,
        format="ply",
    )


def ply_bytes(gaussians, folder):
    path = Path(folder) / "standard.ply"
    standard_ply.write(gaussians, path)
    return path.read_bytes()


def splat_bytes(gaussians):
    """A .splat of the Gaussians, as antimatter15's converter writes it."""
    quats = gaussians.quats / np.linalg.norm(gaussians.quats, axis=1, keepdims=True)
    alphas = 1 / (1 + np.exp(-gaussians.opacities[:, None]))
    colors = np.concatenate([0.5 + 0.28209479177387814 * gaussians.dc, alphas], 1)
    return b"".join(
        struct.pack("<6f", *mean, *scale) + bytes(color) + bytes(quat)
        for mean, scale, color, quat in zip(
            gaussians.means,
            np.exp(gaussians.log_scales),
            (colors * 255).clip(0, 255).astype(np.uint8),
            (quats * 128 + 128).clip(0, 255).astype(np.uint8),
            strict=True,
        )
    )


def same(a, b):
    """Whether two sets of raw Gaussians hold the same bits."""
    names = ("means", "dc", "rest", "opacities", "log_scales", "quats", "normals")
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names)
