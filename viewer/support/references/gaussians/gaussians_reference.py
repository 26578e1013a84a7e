"""Gaussians at rest and the picture of them that Python draws.

Run: python gaussians_reference.py OUT [--bundle FILE] [--gaussians N] [--size WxH]

Writes OUT/gaussians.f32 (N, 14: centre, rotation wxyz, scales, colour, opacity), OUT/view.json
(camera from world (3, 4), lens fx, fy, cx, cy, background) and OUT/picture.u8 (H, W, 3). Without a
bundle the Gaussians are random: small and large, round and thin, opaque and faint, inside and
outside of the picture, some behind the camera.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar.render_bundle import avatar_gaussians, visitor_camera
from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import CameraInfo
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

CAMERA = CameraInfo((0.3, 0.2, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0)
BACKGROUND = (0.2, 0.4, 0.6)


def random_gaussians(count: int) -> Gaussians:
    """Most of them within 0.7 m of the origin, one in ten anywhere, behind the camera too."""
    rng = np.random.default_rng(3)
    means = rng.normal(0, 0.35, (count, 3))
    means[::10] *= 5
    thin = np.exp(rng.normal(0, 1.2, (count, 3))) * 0.4 / np.sqrt(count)
    arrays = (means, rng.normal(size=(count, 4)), thin, rng.beta(0.5, 0.5, count))
    tensors = [torch.tensor(array, dtype=torch.float32) for array in arrays]
    return Gaussians(*tensors, torch.tensor(rng.random((count, 3)), dtype=torch.float32))


def bundled_gaussians(bundle: Bundle, time: float) -> Gaussians:
    """The avatar at a time, with its idle face."""
    head = bundle.manifest.head
    return avatar_gaussians(bundle, time, head.idle_expression if head else None)


def main() -> None:
    """Does what the file's docstring says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--bundle", type=Path)
    parser.add_argument("--gaussians", type=int, default=2000)
    parser.add_argument("--size", default="200x150")
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    if arguments.bundle:
        bundle = Bundle.open(arguments.bundle)
        gaussians, info = bundled_gaussians(bundle, 0.5), bundle.manifest.camera
        background = bundle.manifest.background
    else:
        gaussians, info, background = random_gaussians(arguments.gaussians), CAMERA, BACKGROUND
    camera = visitor_camera(info, width, height)
    with torch.no_grad():
        picture = render(gaussians, [camera], torch.tensor(background)).rgb[0].numpy()
    parts = (gaussians.means, gaussians.quats, gaussians.scales, gaussians.colors)
    rows = torch.cat([*parts, gaussians.opacities[:, None]], 1)  # (N, 14)
    rows.float().numpy().tofile(arguments.out / "gaussians.f32")
    np.uint8(np.round(picture.clip(0, 1) * 255)).tofile(arguments.out / "picture.u8")
    k = camera.intrinsics
    lens = [k[0, 0], k[1, 1], k[0, 2], k[1, 2]]
    view = {"view": camera.world_to_camera[:3].tolist(), "lens": lens, "background": background}
    (arguments.out / "view.json").write_text(json.dumps(view))


if __name__ == "__main__":
    main()
