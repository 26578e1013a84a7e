"""A bundle whose picture tells the time: red and green follow expression values 0 and 1.

Run: python phase_bundle.py OUT

Writes OUT/NAME for every file of the bundle: one large Gaussian whose red and green logits are the
first two expression values, so that a track of (cos 2πt, sin 2πt) shows t's phase as a colour.
"""

import io
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from ico3d.bundle.format import Bundle, write_bundle
from ico3d.bundle.head import BakedHead, no_displacements, poses_to_bytes
from ico3d.bundle.manifest import CameraInfo, HeadInfo, Loss, Manifest, Persona, Provenance

SIZE = 2  # expression values
STEP = np.float32(1 / 100)  # logits per basis unit


def phase_head() -> BakedHead:
    """Logit j = expression value j, through LeakyReLU(x) − LeakyReLU(−x) = 1.02·x."""
    basis = np.zeros((SIZE, 1, 4), np.int8)
    basis[0, 0, 0] = basis[1, 0, 1] = 100
    signs = np.hstack([np.eye(SIZE), -np.eye(SIZE)]).astype(np.float32)  # (B, H)
    return BakedHead(
        means=np.zeros((1, 3), np.float32),
        quats=np.float16([[1, 0, 0, 0]]),
        scales=np.full((1, 3), np.log(0.3), np.float16),
        mean_logits=np.float16([[0, 0, 0, 8]]),
        basis=basis,
        basis_scale=np.full(1, STEP),
        **no_displacements(1, SIZE),
        w1=signs,
        b1=np.zeros(2 * SIZE, np.float32),
        w2=signs.T / np.float32(1.02),
        b2=np.zeros(SIZE, np.float32),
    )


def phase_manifest() -> Manifest:
    """Driven by two blendshapes, seen from 0.8 m."""
    names = ("cosine", "sine")
    head = HeadInfo(1, SIZE, 2 * SIZE, "blendshapes", SIZE, None, names, 25.0, 1, (0.0, 0.0))
    camera = CameraInfo((0.0, 0.0, 0.8), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 24.0)
    provenance = Provenance("clock", ("computed",), "none needed", "CC0-1.0")
    persona, loss = Persona("Clock", "", ()), Loss(None, None, None)
    return Manifest("clock", head, None, None, camera, (0.0, 0.0, 0.0), persona, loss, provenance)


def main() -> None:
    """Does what the file's docstring says."""
    out = Path(sys.argv[1])
    picture = io.BytesIO()
    Image.new("RGB", (8, 8)).save(picture, "PNG")
    files = {
        "head.safetensors": phase_head().to_bytes(),
        "head_poses.safetensors": poses_to_bytes(np.eye(4, dtype=np.float32)[None]),
        "thumbnail.png": picture.getvalue(),
    }
    write_bundle(out / "clock.ico3d", phase_manifest(), files)
    bundle = Bundle.open(out / "clock.ico3d")
    for name in bundle.names:
        (out / name).write_bytes(bundle.read(name))


if __name__ == "__main__":
    main()
