"""How far fitted joints are from the true ones of a synthetic person.

    python bench/posing.py CAPTURE SUBJECT.npz [--json FILE] [--annotated]

CAPTURE is what `ico3d capture synthetic --rig body` wrote and `ico3d capture pose` fitted. With
`--annotated` the track is not read: the skeleton is fitted to the true joints among the 133 points
that DNA-Rendering annotates, with noise and without masks.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from ico3d.capture.formats import open_capture
from ico3d.capture.posing.model.landmarks import LANDMARKS
from ico3d.capture.posing.model.naming import COCO_WHOLE_BODY
from ico3d.capture.posing.model.template import load_template
from ico3d.capture.posing.seeing.evidence import ANNOTATED_STRAY, Evidence
from ico3d.capture.posing.seeing.outlines import Outlines
from ico3d.capture.posing.tracking import fit
from ico3d.cli import run_script
from ico3d.errors import CaptureError
from ico3d.rig.body_track import BodyTrack
from ico3d.studio.truth import TrueJoints, true_joints

MAIN = ("upperarm01", "lowerarm01", "wrist", "upperleg01", "lowerleg01", "foot", "neck01", "head")
"""Shoulders, elbows, wrists, hips, knees, ankles, neck and head."""
NOISE = 0.003
"""Metres along each axis by which annotated joints err."""


@dataclass(frozen=True)
class Posing:
    """The bench.

    Attributes:
        capture: Recording of a synthetic person's whole body.
        subject: Subject file (.npz) that it shows.
        annotated: Do not read the track: fit a skeleton to true joints with noise.
        json: Where to write the table.
    """

    capture: tyro.conf.Positional[Path]
    subject: tyro.conf.Positional[Path]
    annotated: bool = False
    json: Path | None = None

    def run(self) -> None:
        """Prints a table, and writes it as JSON."""
        true = true_joints(self.capture, self.subject)
        track = annotated(self.capture, true) if self.annotated else fitted(self.capture)
        found = errors(track, true)
        groups = {
            "body": [name for name in found if name.split(".")[0] in MAIN],
            "fingers": [name for name in found if name.startswith("finger")],
        }
        table = {group: figures(found, names) for group, names in groups.items()}
        for group, row in table.items():
            print(f"{group:8}", *(f"{key} {value:.1f} mm" for key, value in row.items()))
        for name in groups["body"]:
            middle = np.median(np.linalg.norm(found[name], axis=1))
            constant = np.linalg.norm(found[name].mean(0))
            print(f"{name:14} median {middle:5.1f} mm, constant {constant:5.1f}")
        if self.json is not None:
            self.json.write_text(json.dumps(table, indent=1))


def fitted(capture: Path) -> BodyTrack:
    """The track that lies in a recording."""
    track = open_capture(capture).body_track()
    if track is None:
        raise CaptureError(f"{capture} has no track: run ico3d capture pose {capture} first.")
    return track


def annotated(capture: Path, true: TrueJoints) -> BodyTrack:
    """A track fitted to true joints with noise."""
    names = list(LANDMARKS)
    points = np.zeros((len(true.places), len(names), 3))
    for name in COCO_WHOLE_BODY.values():
        landmark = LANDMARKS[name]
        if landmark.bone in true.names and landmark.end == "head":
            points[:, names.index(name)] = true.places[:, true.names.index(landmark.bone)]
    known = np.asarray(points.any(-1))
    points += known[..., None] * np.random.default_rng(0).normal(0, NOISE, points.shape)
    roots = np.where(known, 1 / ANNOTATED_STRAY, 0.0)[..., None, None] * np.eye(3)
    nothing = Outlines.empty(len(points), [])
    evidence = Evidence(points, roots, nothing, "true joints with noise", False)
    return fit(open_capture(capture), load_template(), evidence, lambda: None).track


def errors(track: BodyTrack, true: TrueJoints) -> dict[str, np.ndarray]:
    """By joint (F, 3) millimetres from true to fitted places, of fitted frames."""
    places = track.joints()
    return {
        name: 1e3
        * (places[:, track.rig.index(name)] - true.places[:, true.names.index(name)])[track.fitted]
        for name in track.rig.names
        if name in true.names
    }


def figures(found: dict[str, np.ndarray], names: list[str]) -> dict[str, float]:
    """Median, 95 % and largest error of some joints together, and the median less constants."""
    every = np.concatenate([np.linalg.norm(found[name], axis=1) for name in names])
    moving = [np.linalg.norm(found[name] - found[name].mean(0), axis=1) for name in names]
    return {
        "median": float(np.median(every)),
        "p95": float(np.percentile(every, 95)),
        "largest": float(every.max()),
        "less constants": float(np.median(np.concatenate(moving))),
    }


if __name__ == "__main__":
    sys.exit(run_script(Posing))
