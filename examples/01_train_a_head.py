"""Records a synthetic person who talks, and trains a head on the recording.

    python examples/01_train_a_head.py --out runs/example

About ten minutes on two CPU cores. Takes the extras `train`, `synthetic` and `voice`.
"""

from dataclasses import replace
from pathlib import Path

import tyro

from ico3d.capture.formats import open_capture
from ico3d.head.settings import PRESETS
from ico3d.head.train_head import HeadJob, train_head
from ico3d.studio.command import Synthetic


def main(
    out: Path = Path("runs/example"),
    frames: int = 440,
    size: int = 192,
    steps: int = 1_500,
    gaussians: int = 8_000,
) -> None:
    """Writes OUT/capture and the model folder OUT/head.

    Args:
        out: Folder to write.
        frames: Frames of the recording; the last eleventh trains nothing.
        size: Height of the pictures.
        steps: Training steps, one picture each.
        gaussians: The most that the head may have.
    """
    if not (out / "capture" / "capture.json").is_file():
        Synthetic(out / "capture", frames=frames, size=size).run()
    capture = open_capture(out / "capture")

    cpu = PRESETS["cpu"]
    settings = replace(
        cpu,
        steps=steps,
        initial=replace(cpu.initial, gaussians=gaussians // 2),
        density=replace(cpu.density, max_gaussians=gaussians),
    )
    job = HeadJob(inputs="speech", variant="full", encoder="builtin", seed=0, settings=settings)
    head = train_head(capture, out / "head", job)  # goes on where it was interrupted

    print(f"{out / 'head'}: {len(head.model)} Gaussians")


if __name__ == "__main__":
    tyro.cli(main)
