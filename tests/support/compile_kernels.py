"""Compiles the kernels of training and the tests once, before processes share the tests.

A process that has just compiled a kernel may round otherwise than those that find it compiled, and
processes that compile the same kernel at once leave either's. Trainings that must give the same
files therefore start when all kernels lie in numba's cache. Tests and what they import are compiled
beside them, for each of those processes would do so otherwise.
"""

import gc
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numba
import pytest
import torch

from ico3d.body.training.train_clip import train_window
from ico3d.head.train_head import HeadJob, train_head
from ico3d.studio import recording
from support.bodies.recorded_capture import record
from support.bodies.tiny_training import trainer_of
from support.bodies.tracked_capture import TrackedCapture
from support.bodies.window_tasks import tasks
from support.heads.tiny_capture import TinyCapture
from support.heads.train_tiny import SETTINGS

PICTURE = recording.Recording(
    subject="anny",
    rig="bust",
    cameras=1,
    frames=1,
    fps=25.0,
    views_per_frame=1,
    size=64,
    text="",
    seed=0,
    lively=False,
    light="studio",
    motion="showcase",
)
"""Touches the studio's kernels but those of trousers, shoes and skirts."""


def main() -> None:
    """Leaves Python's and numba's caches filled."""
    gc.set_threshold(100_000, 50, 100)  # little of what a compiler makes is garbage
    compile_kernels()
    if not sys.dont_write_bytecode:
        pytest.main(["--collect-only"])  # its assertions are not Python's


def compile_kernels() -> None:
    """Trains a head and bodies and draws a person, as briefly as touches kernels."""
    numba.set_num_threads(1)
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        brief = replace(SETTINGS, steps=45)
        train_head(
            TinyCapture(folder / "tiny"),
            folder / "head",
            HeadJob("blendshapes", "full", "builtin", 0, brief),
        )
        record(folder / "clip")
        for task in tasks(folder / "clip", folder / "body", steps_per_frame=8):
            train_window(task)
        hung = {"skinning.shadow": True, "initial.source": "hull"}
        trainer_of(TrackedCapture(folder / "hung"), "skinned", **hung).step(0)
        recording.record(PICTURE, folder / "studio", 1)


if __name__ == "__main__":
    main()
