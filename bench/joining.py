"""What pruning, border Gaussians and matched colours are worth where a head meets a body.

    python bench/joining.py HEAD CAPTURE OUT [--frames 16] [--seeds 3] [--json F]

HEAD is a folder of ico3d train head, CAPTURE a capture of the same person's whole body. Each
variant and seed is an ico3d assemble of its own under OUT; finished ones are not repeated.
OUT/variants.jpg shows recorded pictures and the variants, beside one another.
"""

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from PIL import Image
from rich.console import Console
from rich.table import Table

from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.joining.assemble import Assembly, assemble
from ico3d.avatar.joining.face_views import face_views
from ico3d.avatar.joining.settings import JoiningSettings
from ico3d.body.settings import BodySettings
from ico3d.capture.capture import Capture
from ico3d.capture.face.region import HeadRegion
from ico3d.cli import run_script
from ico3d.common.camera import Camera
from ico3d.measure.methods.bench import open_clip
from ico3d.measure.methods.settings import OURS, preset
from ico3d.splat.render import render

VARIANTS = {
    "full": JoiningSettings(),
    "no pruning": JoiningSettings(pruning=False),
    "no border": JoiningSettings(border_points=0),
    "no colours": JoiningSettings(match_colors=False),
}
SCORES = ("psnr_border", "psnr_face", "color_step", "gap_mm")
VIEWS, ENLARGED = 5, 320


@dataclass(frozen=True)
class Joining:
    """The bench.

    Attributes:
        head: Folder of the trained head.
        capture: Of the whole body.
        out: Where avatars lie.
        frames: Of the capture, from its first on.
        seeds: How many.
        json: Also write figures here.
        settings: How the bodies are trained.
    """

    head: tyro.conf.Positional[Path]
    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    frames: int = 16
    seeds: int = 3
    json: Path | None = None
    settings: Annotated[BodySettings, tyro.conf.arg(name="")] = field(
        default_factory=lambda: preset(OURS).without_finetuning()
    )

    def run(self) -> None:
        """Assembles, measures, draws."""
        capture = open_clip(self.capture, self.frames)
        avatars: dict[str, list[TrainedAvatar]] = {}
        for seed in range(self.seeds):
            for name, joining in VARIANTS.items():
                folder = self.out / f"{name.replace(' ', '-')}-{seed}"
                assembly = Assembly(self.head, joining, self.settings, seed)
                avatar = assemble(capture, folder, assembly, lambda words: None)
                avatars.setdefault(name, []).append(avatar)
                figures = {key: avatar.summary.get(key) for key in SCORES}
                print(f"seed {seed}, {name}: {figures}", flush=True)
        found = {name: _mean(some) for name, some in avatars.items()}
        _show(found)
        first = {name: some[0] for name, some in avatars.items()}
        _pictures(first, capture).save(self.out / "variants.jpg", quality=90)
        if self.json:
            self.json.write_text(json.dumps(found, indent=1))


def _mean(avatars: list[TrainedAvatar]) -> dict[str, float]:
    return {key: float(np.mean([a.summary[key] for a in avatars])) for key in SCORES}


def _show(found: dict[str, dict[str, float]]) -> None:
    table = Table(title="head on body, means over seeds")
    for column in ("variant", *SCORES):
        table.add_column(column)
    for name, scores in found.items():
        table.add_row(name, *(f"{scores[key]:.4g}" for key in SCORES))
    Console().print(table)


@torch.no_grad()
def _pictures(avatars: dict[str, TrainedAvatar], capture: Capture) -> Image.Image:
    """Recorded | one column per variant, one row per view by a test camera."""
    any_avatar = next(iter(avatars.values()))
    landmarks = any_avatar.head.landmarks
    assert landmarks is not None
    region, cameras = HeadRegion.around(landmarks), capture.split.test_cameras
    views = face_views(capture, any_avatar.placement, region, landmarks, cameras, VIEWS)
    rows = []
    for view in views:
        size = ENLARGED, round(ENLARGED * view.camera.width / view.camera.height)
        recorded = Image.fromarray((view.image.numpy() * 255 + 0.5).astype(np.uint8))
        row = [np.asarray(recorded.resize((size[1], size[0]), Image.Resampling.BICUBIC)) / 255]
        larger: Camera = view.camera.resized(size[1], size[0])
        for avatar in avatars.values():
            person = avatar.gaussians(view.frame / avatar.fps)
            row.append(render(person, [larger], torch.full((3,), 0.5)).rgb[0].numpy())
        rows.append(np.hstack(row))
    width = min(row.shape[1] for row in rows)
    sheet = np.vstack([row[:, :width] for row in rows]).clip(0, 1)
    return Image.fromarray((sheet * 255 + 0.5).astype(np.uint8))


if __name__ == "__main__":
    sys.exit(run_script(Joining))
