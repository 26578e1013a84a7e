"""Renders an avatar, baked or freshly trained, as a PNG.

    python examples/02_render_an_avatar.py --avatar demo --out demo.png
    python examples/02_render_an_avatar.py --avatar runs/example/head --capture runs/example/capture

Takes the extra `train`.
"""

from pathlib import Path

import numpy as np
import torch
import tyro
from PIL import Image

from ico3d.avatar.poseable import poseable_of
from ico3d.avatar.render_bundle import avatar_gaussians, baked_gaussians, visitor_camera
from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import bundle_path
from ico3d.capture.formats import open_capture
from ico3d.common.camera import Camera
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render


def bundled(path: Path, size: int) -> tuple[Gaussians, Camera]:
    """The person of a bundle at rest, and where visitors stand."""
    bundle = Bundle.open(bundle_path(path))
    head, poses = bundle.require_head()
    camera = visitor_camera(bundle.manifest.camera, size, size)
    rest = bundle.manifest.head.idle_expression if bundle.manifest.head else ()
    if bundle.manifest.body:
        return avatar_gaussians(bundle, 0.0, rest), camera
    if person := poseable_of(bundle, None):  # on a skeleton
        by_role, root = person.performer(0).at(np.zeros(1))  # (1, R, 4), (1, 3)
        return person.gaussians(by_role[0], root[0], np.array(rest)), camera
    return baked_gaussians(head, np.array(rest)).transform(poses[0]), camera


def trained(folder: Path, recording: Path) -> tuple[Gaussians, Camera]:
    """A trained head as it speaks in the first frame, seen by the recording's first camera."""
    head, capture = TrainedHead.load(folder), open_capture(recording)
    expression = head.track(capture).at(0)
    return head.model(expression).transform(capture.world_from_head(0)), capture.cameras[0]


@torch.no_grad()
def main(
    avatar: Path, capture: Path | None = None, out: Path = Path("avatar.png"), size: int = 512
) -> None:
    """Writes a PNG of AVATAR: a bundle or, with the capture that it was trained on, a head."""
    gaussians, camera = trained(avatar, capture) if capture else bundled(avatar, size)
    picture = render(gaussians, [camera], background=torch.ones(3)).rgb[0]  # (H, W, 3)
    Image.fromarray((picture.clamp(0, 1) * 255).byte().numpy()).save(out)
    print(f"{out}: {len(gaussians)} Gaussians")


if __name__ == "__main__":
    tyro.cli(main)
