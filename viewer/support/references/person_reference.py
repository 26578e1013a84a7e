"""A whole person – a body and a random head on it, on a floor – as Python draws it.

Run: python person_reference.py OUT [--body windows|skinned] [--gaussians N,N] [--times S,…]
    [--pictures WxH]

Writes OUT/person.ico3d, OUT/bundle/ (its files), OUT/poses.json (the head's place in each frame)
and, if asked, OUT/pictures.u8 (T, H, W, 3) of the times and OUT/painted.u8: the same with the head
painted over the body, as if nothing of the body were before it.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from body_reference import BORDERS, write_body

from ico3d.avatar.baking.persona import load_persona
from ico3d.avatar.render_bundle import (
    avatar_gaussians,
    body_gaussians,
    render_bundle,
    visitor_camera,
)
from ico3d.bundle.animation import Action, Animation, Rest
from ico3d.bundle.format import ANIMATION, FIRST_BYTES, Bundle, coarse_first, write_bundle
from ico3d.bundle.head import POSES, poses_to_bytes
from ico3d.common.camera import Camera
from ico3d.splat.files.formats import write_gaussians
from ico3d.splat.files.raw import RawGaussians
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render
from support.bundles.random_bundle import random_files, random_head, random_manifest
from support.bundles.skinned_person import write_capsule_person

FPS = 15.0
ANIMATED = Animation(FPS, BORDERS[-1] + 1, Rest(0, 12), (Action(24, 0.9), Action(40, 0.7)))
FLOOR = 400  # Gaussians
PERSONA = Path(__file__).with_name("persona.json")


def head_poses() -> np.ndarray:
    """(F, 4, 4): above the shoulders, leaning from side to side and turning."""
    poses = np.tile(np.eye(4, dtype=np.float32), (ANIMATED.num_frames, 1, 1))
    seconds = np.arange(ANIMATED.num_frames) / FPS
    turn = 0.4 * np.sin(2 * np.pi * 0.3 * seconds)
    poses[:, 0, 0] = poses[:, 2, 2] = np.cos(turn)
    poses[:, 0, 2], poses[:, 2, 0] = np.sin(turn), -np.sin(turn)
    poses[:, :3, 3] = (0.0, 1.68, 0.0)
    poses[:, 0, 3] += 0.08 * np.sin(2 * np.pi * 0.35 * seconds)
    return poses


def floor() -> Gaussians:
    """What the person stands on."""
    rng = np.random.default_rng(5)
    means = rng.uniform((-0.7, -0.03, -0.7), (0.7, 0.0, 0.7), (FLOOR, 3))
    return Gaussians(
        means=torch.tensor(means, dtype=torch.float32),
        quats=torch.tensor([[1.0, 0, 0, 0]]).repeat(FLOOR, 1),
        scales=torch.tensor([[0.04, 0.005, 0.04]]).repeat(FLOOR, 1),
        opacities=torch.full((FLOOR,), 0.8),
        colors=torch.tensor(rng.uniform(0.3, 0.6, (FLOOR, 3)), dtype=torch.float32),
    )


def write_person(path: Path, kind: str, on_head: int, on_body: int, first: int) -> None:
    """The body's own head stays: some of its Gaussians lie before the other head, some behind."""
    body_path = path.with_name("body.ico3d")
    if kind == "skinned":
        write_capsule_person(body_path, on_body, ANIMATED.num_frames)
    else:
        write_body(body_path, on_body)
    body, head = Bundle.open(body_path), random_head(on_head)
    info = random_manifest(head)
    assert info.head is not None
    manifest = replace(
        body.manifest,
        persona=load_persona(PERSONA),
        head=replace(info.head, fps=FPS, num_poses=ANIMATED.num_frames),
        speech=info.speech,
    )
    files = random_files(head) | {name: body.read(name) for name in body.manifest.files}
    files |= {POSES: poses_to_bytes(head_poses()), ANIMATION: ANIMATED.to_bytes()}
    ground = path.with_name("background.ply")
    write_gaussians(ground, RawGaussians.from_gaussians(floor()))
    files[ground.name] = ground.read_bytes()
    write_bundle(path, *coarse_first(manifest, files, first))


def draw(bundle: Bundle, times: list[float], width: int, height: int, out: Path) -> None:
    """Right pictures and painted ones, with the idle face."""
    info, poses = bundle.manifest.head, bundle.world_from_head
    assert info is not None
    assert poses is not None
    camera, face = visitor_camera(bundle.manifest.camera, width, height), info.idle_expression
    colour = torch.tensor(bundle.manifest.background)
    right, painted = [], []
    for time in times:
        right.append(picture([avatar_gaussians(bundle, time, face), floor()], camera, colour))
        behind = picture([body_gaussians(bundle, time), floor()], camera, colour)
        painted.append(render_bundle(bundle, face, camera, behind, poses[round(time * FPS)]))
    for name, pictures in (("pictures", right), ("painted", painted)):
        np.uint8(np.round(np.stack(pictures).clip(0, 1) * 255)).tofile(out / f"{name}.u8")


def picture(parts: list[Gaussians], camera: Camera, colour: torch.Tensor) -> np.ndarray:
    """(H, W, 3)."""
    with torch.no_grad():
        return render(cat(parts), [camera], colour).rgb[0].numpy()


def main() -> None:
    """Does what the file's docstring says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--body", default="windows")
    parser.add_argument("--gaussians", default="1500,1500", help="on the head, on the body")
    parser.add_argument("--first", type=int, default=FIRST_BYTES, help="bytes of first files")
    parser.add_argument("--times", default="")
    parser.add_argument("--pictures", help="WxH")
    arguments = parser.parse_args()
    out = arguments.out
    on_head, on_body = map(int, arguments.gaussians.split(","))
    write_person(out / "person.ico3d", arguments.body, on_head, on_body, arguments.first)
    bundle = Bundle.open(out / "person.ico3d")
    for name in bundle.names:
        (out / "bundle" / name).parent.mkdir(parents=True, exist_ok=True)
        (out / "bundle" / name).write_bytes(bundle.read(name))
    (out / "poses.json").write_text(json.dumps(head_poses().tolist()))
    times = [float(time) for time in arguments.times.split(",") if time]
    if arguments.pictures:
        width, height = map(int, arguments.pictures.split("x"))
        draw(bundle, times, width, height, out)


if __name__ == "__main__":
    main()
