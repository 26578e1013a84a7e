"""A body on a skeleton as a bundle, and what Python makes of it: truth for the page.

Run: python skinned_reference.py OUT [--gaussians N] [--times S,S,…] [--few N] [--pictures WxH]

Writes OUT/body.ico3d, OUT/bundle/ (its files), OUT/reference.json (per moment: time, rotations,
root, residual, joint table; the last moment is a pose that was never recorded, its time null),
OUT/splats.f32 (per moment: N × (x, y, z, r, g, b, opacity)) and, if asked, OUT/pictures.u8
((M + 1), H, W, 3), the last one of the last pose in the FEW most important Gaussians.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ico3d.avatar.baked_body import skinned_gaussians
from ico3d.avatar.render_bundle import visitor_camera
from ico3d.bundle.format import Bundle
from ico3d.bundle.skinned.posing import SkinnedPose, any_pose, joint_table, recorded_pose
from ico3d.splat.render import render
from support.bundles.skinned_person import unseen_pose, write_capsule_person

ROOT = np.array([0.1, 0.02, -0.1])


def main() -> None:
    """Does what the file's docstring says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--gaussians", type=int, default=1500)
    parser.add_argument("--times", default="")
    parser.add_argument("--few", type=int, default=1)
    parser.add_argument("--pictures", help="WxH")
    arguments = parser.parse_args()
    out = arguments.out
    write_capsule_person(out / "body.ico3d", arguments.gaussians)
    bundle = Bundle.open(out / "body.ico3d")
    for name in bundle.names:
        (out / "bundle" / name).parent.mkdir(parents=True, exist_ok=True)
        (out / "bundle" / name).write_bytes(bundle.read(name))
    baked = bundle.skinned
    assert baked is not None
    times = [float(time) for time in arguments.times.split(",") if time]
    poses: list[tuple[float | None, SkinnedPose]] = [
        (time, recorded_pose(baked, time * baked.info.fps)) for time in times
    ]
    poses.append((None, any_pose(baked, unseen_pose(), ROOT)))
    moments: list[dict[str, Any]] = [
        {
            "time": time,
            **{name: values.ravel().tolist() for name, values in vars(pose).items()},
            "table": joint_table(baked, pose).ravel().tolist(),
        }
        for time, pose in poses
    ]
    (out / "reference.json").write_text(json.dumps(moments))
    with (out / "splats.f32").open("wb") as file:
        for _, pose in poses:
            g = skinned_gaussians(baked, pose)
            rows = np.hstack([g.means, g.colors, g.opacities[:, None]])  # (N, 7)
            rows.astype(np.float32).tofile(file)
    if arguments.pictures:
        width, height = map(int, arguments.pictures.split("x"))
        camera = visitor_camera(bundle.manifest.camera, width, height)
        behind = torch.tensor(bundle.manifest.background)
        drawn = [skinned_gaussians(baked, pose) for _, pose in poses]
        drawn.append(skinned_gaussians(baked, poses[-1][1], arguments.few))
        pictures = np.stack([render(g, [camera], behind).rgb[0].numpy() for g in drawn])
        np.uint8(np.round(pictures.clip(0, 1) * 255)).tofile(out / "pictures.u8")


if __name__ == "__main__":
    main()
