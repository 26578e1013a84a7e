"""How far from the truth assemble puts a head whose recording had no landmarks.

    python bench/placing.py human_face_f.npz human_face_m.npz --work WORK [--seeds 3] [--json F]

Each subject is recorded in two studios, head and shoulders in neutral light, the whole body in warm
light, and its head trained as a recording of RenderMe-360 without landmarks teaches it: no
landmarks, no eye values, surface points on the head alone. Both recordings have the subject's true
head poses, so that G ought to be the identity. What WORK holds already is not made again.
"""

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.assemble import align
from ico3d.avatar.joining.cropping import cropped
from ico3d.avatar.joining.finding.found_placement import found_in_pictures
from ico3d.avatar.joining.similarity import moved
from ico3d.capture.capture import Capture
from ico3d.capture.face.canonical import canonical_landmarks
from ico3d.capture.face.region import HeadRegion
from ico3d.capture.formats import open_capture
from ico3d.capture.importing.resized import ResizedCapture
from ico3d.cli import run_script
from ico3d.head.model_folder import TrainedHead
from ico3d.head.settings import PRESETS, HeadSettings, Initial
from ico3d.head.train_head import HeadJob, train_head

SHOTS = {
    "head": (0, "--rig bust --light studio --cameras 8 --frames 176 --size 224"),
    "body": (10, "--rig body --light warm --cameras 16 --frames 6 --size 612 --fps 3"),
}
"""Recordings: what is added to the seed, and how they are made."""
BELOW_CHIN = -0.12
"""Metres: the head's points begin above."""

SHORT = replace(
    PRESETS["cpu"],
    steps=1_000,
    initial=Initial(gaussians=5_000),
    density=replace(PRESETS["cpu"].density, max_gaussians=7_000, until=800),
)
"""Settings of heads that are good enough to find a face in."""


@dataclass(frozen=True)
class Placing:
    """The bench.

    Attributes:
        subjects: Subject files (.npz) of ico3d capture synthetic, with a body.
        work: Folder for recordings and heads.
        seeds: Of recordings and trainings, per subject.
        json: Where to write the figures.
        settings: How the heads are trained.
    """

    subjects: tyro.conf.Positional[tuple[Path, ...]]
    work: Path
    seeds: int = 3
    json: Path | None = None
    settings: Annotated[HeadSettings, tyro.conf.arg(name="")] = SHORT

    def run(self) -> None:
        """Records, trains, places, measures."""
        torch.set_num_threads(1)
        rows = [self._measured(s, seed) for seed in range(self.seeds) for s in self.subjects]
        means = [np.mean([row["found"][i] for row in rows]) for i in (0, 1)]
        print(f"mean: Gaussians {means[0]:.2f} mm, landmarks {means[1]:.2f} mm")
        if self.json:
            self.json.write_text(json.dumps(rows, indent=1) + "\n")

    def _measured(self, subject: Path, seed: int) -> dict:
        """Millimetres of one head on one body."""
        folder = self.work / f"{subject.stem}-{seed}"
        for name, (later, shot) in SHOTS.items():
            if not (folder / name / "capture.json").exists():
                _record(subject, folder / name, seed + later, shot)
        recording, body = open_capture(folder / "head"), open_capture(folder / "body")
        head = self._trained(recording, folder / "model", seed)
        said: list[str] = []
        found, placement = found_in_pictures(head, body, folder, said.append, torch.device("cpu"))
        assert found.landmarks is not None and placement is not None, said
        drawn = cropped(found, HeadRegion.around(found.landmarks)).model.means.detach().numpy()
        truth = drawn.astype(float), canonical_landmarks(recording)
        mixed = align(body, found.landmarks, said.append)
        row = {
            "head": folder.name,
            "found": [_away(placement, points) for points in truth],
            "mixed": [_away(mixed, points) for points in truth],
            "said": said,
        }
        print(json.dumps(row), flush=True)
        return row

    def _trained(self, recording: Capture, folder: Path, seed: int) -> TrainedHead:
        """A head whose recording says little."""
        if (folder / "finished.json").exists():
            return TrainedHead.load(folder)
        job = HeadJob("speech", "full", "builtin", seed, self.settings)
        return train_head(Unmarked(recording), folder, job)


class Unmarked(ResizedCapture):
    """A recording without landmarks and eyes, whose points are on the head alone."""

    def __init__(self, capture: Capture):
        super().__init__(capture, max(camera.height for camera in capture.cameras))

    def landmarks(self, camera: int, frame: int) -> None:
        """None."""

    def landmarks_3d(self, frame: int) -> None:
        """None."""

    def eyes(self, frame: int) -> None:
        """None."""

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) those above the chin."""
        points = super().head_points(frame)
        return None if points is None else points[points[:, 1] > BELOW_CHIN]


def _record(subject: Path, out: Path, seed: int, shot: str) -> None:
    verb = [sys.executable, "-m", "ico3d.cli", "capture", "synthetic", str(out), *shot.split()]
    if subprocess.run([*verb, "--subject", str(subject), "--seed", str(seed)]).returncode:
        sys.exit(f"recording {out} failed.")


def _away(placement: Placement, points: np.ndarray | None) -> float:
    """Millimetres, mean over points (P, 3), by which G is not the identity that it ought to be."""
    assert points is not None
    there = moved(placement.canonical_from_head, points)
    return round(1e3 * float(np.linalg.norm(there - points, axis=1).mean()), 2)


if __name__ == "__main__":
    sys.exit(run_script(Placing))
