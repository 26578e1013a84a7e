"""How far fitted joints are from the true ones of a synthetic person.

    python bench/posing.py CAPTURE SUBJECT.npz [--json FILE]

CAPTURE is what `ico3d capture synthetic --rig body` wrote and `ico3d capture pose` fitted.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from ico3d.capture.formats import open_capture
from ico3d.studio.truth import true_joints

MAIN = ("upperarm01", "lowerarm01", "wrist", "upperleg01", "lowerleg01", "foot", "neck01", "head")
"""Shoulders, elbows, wrists, hips, knees, ankles, neck and head."""


def errors(capture: Path, subject: Path) -> dict[str, np.ndarray]:
    """By joint (F,) millimetres between fitted and true places, of fitted frames."""
    track = open_capture(capture).body_track()
    if track is None:
        raise SystemExit(f"{capture} has no track: run ico3d capture pose {capture} first.")
    true = true_joints(capture, subject)
    places = track.joints()
    both = [name for name in track.rig.names if name in true.names]
    return {
        name: 1e3
        * np.linalg.norm(
            places[:, track.rig.index(name)] - true.places[:, true.names.index(name)], axis=-1
        )[track.fitted]
        for name in both
    }


def offsets(capture: Path, subject: Path) -> dict[str, float]:
    """By joint the length of the mean error in millimetres: what two rigs name differently."""
    track, true = open_capture(capture).body_track(), true_joints(capture, subject)
    assert track is not None
    places = track.joints()
    return {
        name: 1e3
        * float(
            np.linalg.norm(
                (places[:, track.rig.index(name)] - true.places[:, true.names.index(name)]).mean(0)
            )
        )
        for name in track.rig.names
        if name in true.names
    }


def figures(found: dict[str, np.ndarray], names: list[str]) -> dict[str, float]:
    """Median, 95 % and largest error of some joints together."""
    every = np.concatenate([found[name] for name in names])
    return {
        "median": float(np.median(every)),
        "p95": float(np.percentile(every, 95)),
        "largest": float(every.max()),
    }


def main() -> None:
    """Prints a table, and writes it as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("capture", type=Path)
    parser.add_argument("subject", type=Path)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    found = errors(arguments.capture, arguments.subject)
    groups = {
        "body": [name for name in found if name.split(".")[0] in MAIN],
        "fingers": [name for name in found if name.startswith("finger")],
    }
    table = {group: figures(found, names) for group, names in groups.items()}
    for group, row in table.items():
        print(f"{group:8}", *(f"{key} {value:.1f} mm" for key, value in row.items()))
    constant = offsets(arguments.capture, arguments.subject)
    for name in groups["body"]:
        print(f"{name:14} median {np.median(found[name]):5.1f} mm, constant {constant[name]:5.1f}")
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(table, indent=1))


if __name__ == "__main__":
    main()
