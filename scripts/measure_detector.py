"""Measures where MediaPipe's points lie beside the template's, on synthetic people of many shapes.

    python scripts/measure_detector.py SUBJECT.npz FOLDER [--people 50]

The person of a subject file is given random shapes of the template, clothes and all, and recorded;
what cameras agree on is compared with the true joints. A ridge regression over the shapes, left and
right together, is written to `ico3d/capture/posing/data/mediapipe.json`. The folder keeps what was
measured, so that a later call goes on. Takes ten seconds of processor time per person, and
MediaPipe's models (docs/captures/body.md).
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from ico3d.capture.formats import open_capture
from ico3d.capture.posing.fitting.body import mixed
from ico3d.capture.posing.model.detector import FILE
from ico3d.capture.posing.model.landmarks import LANDMARKS
from ico3d.capture.posing.model.naming import MEDIAPIPE_POSE, opposite
from ico3d.capture.posing.model.template import Template, load_template
from ico3d.capture.posing.seeing.agreement import NAMES, agreed_body
from ico3d.capture.posing.seeing.sightings import watcher
from ico3d.common.files import write_atomic
from ico3d.studio.recording import Recording, record
from ico3d.studio.truth import true_joints

MEASURED = [n for n in MEDIAPIPE_POSE if not n.startswith(("thumb", "index", "little"))]
"""Hands are read by another model, whose points are about joints."""
FIRST_SEED = 1000
STIFF = 1e-5
"""Metres squared by which a shape coefficient of 1 weighs where a person's own shape is sought."""
RIDGE = 2.0
"""People who say that a shape changes nothing."""
STRANGERS = 5.0
"""Millimetres by which people who are no such template may differ more than these."""
MIRROR = np.array([-1.0, 1.0, 1.0])
Arrays = dict[str, np.ndarray]


def own_shape(template: Template, person: Arrays) -> tuple[np.ndarray, np.ndarray]:
    """Shape (K,) and move (3,) that bring the template's joints to a person's (least squares)."""
    names = [str(name) for name in person["joint_names"]]
    known = [j for j, name in enumerate(template.names) if name in names]
    there = person["joint_pos"][[names.index(template.names[j]) for j in known]].astype(float)
    basis = template.joints[1:, known].reshape(template.num_shapes, -1).T  # (3 J, K)
    system = np.concatenate([basis, np.tile(np.eye(3), (len(known), 1))], 1)
    little = np.diag(np.append(np.full(template.num_shapes, STIFF), np.zeros(3)))
    missing = (there - template.joints[0, known]).ravel()
    solved = np.linalg.solve(system.T @ system + little, system.T @ missing)
    return solved[:-3], solved[-3:]


def reshaped(template: Template, person: Arrays, shape: np.ndarray) -> Arrays:
    """A person's arrays in another shape: all that is worn follows the nearest skin."""
    own, move = own_shape(template, person)
    tree = KDTree(mixed(template.vertices, own) + move)
    change = shape - own
    field = np.tensordot(change, template.vertices[1:], 1)  # (V, 3)

    def moved(points: np.ndarray) -> np.ndarray:
        away, near = tree.query(points, 8)
        weights = 1 / np.maximum(away, 2e-3) ** 2  # (N, 8)
        weights /= weights.sum(1, keepdims=True)
        return points + (weights[..., None] * field[near]).sum(1)

    found = {name: moved(person[name].astype(float)) for name in ("verts", "joint_pos")}
    found["joint_tail"] = moved(person["joint_tail"].astype(float))
    tables = {"joint_pos": template.joints, "joint_tail": template.tails}
    for number, name in enumerate(map(str, person["joint_names"])):
        if name in template.names:
            joint = template.names.index(name)
            for key, table in tables.items():
                found[key][number] = person[key][number] + change @ table[1:, joint]
    parts = [str(part) for part in person["part_names"]]
    shoes = np.unique(person["faces"][person["face_part"] == parts.index("shoes")])
    lift = person["verts"][shoes, 1].min() - found["verts"][shoes, 1].min()
    lifted = {
        name: (some + np.array([0, lift, 0])).astype(np.float32) for name, some in found.items()
    }
    return {**person, **lifted}


def measured(template: Template, person: Arrays, number: int) -> tuple[np.ndarray, np.ndarray]:
    """A random shape (K,), and metres (P, 3) by which points lie beside landmarks at rest."""
    shape = np.random.default_rng(FIRST_SEED + number).normal(size=template.num_shapes)
    with tempfile.TemporaryDirectory() as name:
        subject = Path(name) / f"somebody_{'mf'[number % 2]}.npz"
        np.savez(subject, allow_pickle=False, **reshaped(template, person, shape))
        recording = Recording(
            subject=str(subject),
            rig="body",
            cameras=7,
            frames=3,
            fps=1.1,
            views_per_frame=7,
            size=288,
            text="Hello there.",
            seed=number,
            lively=True,
            light="studio",
            motion="showcase",
        )
        folder = Path(name) / "clip"
        record(recording, folder, 1)
        with watcher(open_capture(folder), 1) as found:
            found.look(bodies=True)
            seen = found.seen
        bodies = [
            agreed_body(seen.cameras, pixels, weights)
            for pixels, weights in zip(seen.pixels, seen.weights, strict=True)
        ]
        true = true_joints(folder, subject)
    nothing = np.full((len(NAMES), 3), np.nan)
    points = np.stack([nothing if body is None else body.points for body in bodies])
    joints, places = mixed(template.joints, shape), mixed(template.places, shape)
    beside = nothing.copy()
    for name in MEASURED:
        landmark, mark = LANDMARKS[name], NAMES.index(name)
        carrier = true.names.index(landmark.carrier)
        away = points[:, mark] - true.places[:, carrier]  # (F, 3)
        back = np.einsum("fba,fb->fa", true.turns[:, carrier], away)
        if landmark.bone in true.names:
            usual = true.rest[true.names.index(landmark.bone)] - true.rest[carrier]
        else:
            usual = places[mark] - joints[template.names.index(landmark.carrier)]
        beside[mark] = np.nanmean(back - usual, axis=0)
    return shape, beside


def learnt(shapes: np.ndarray, beside: np.ndarray) -> dict[str, dict[str, list]]:
    """By landmark of the left and the middle, millimetres by shape, and what they leave open."""
    system = np.concatenate([np.ones((len(shapes), 1)), shapes], 1)  # (B, 1 + K)
    ridge = np.diag(np.append(1e-6, np.full(shapes.shape[1], RIDGE)))
    solver = np.linalg.solve(system.T @ system + ridge, system.T)  # (1 + K, B)
    lever = np.einsum("bk,kb->b", system, solver)
    found = {}
    for name in MEASURED:
        if name.endswith(".R"):
            continue
        there = beside[:, NAMES.index(opposite(name))] * MIRROR
        both = 1e3 * 0.5 * (beside[:, NAMES.index(name)] + there)  # (B, 3)
        by_shape = solver @ both
        left_out = (both - system @ by_shape) / (1 - lever)[:, None]
        spread = np.sqrt(left_out.std(0) ** 2 + STRANGERS**2)
        found[name] = {"beside": by_shape.round(1).tolist(), "spread": spread.round(1).tolist()}
    return found


def main() -> None:
    """Measures, and writes what was learnt."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("subject", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--people", type=int, default=50)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    template = load_template()
    with np.load(arguments.subject, allow_pickle=False) as archive:
        person = {name: archive[name] for name in archive.files}
    for number in range(arguments.people):
        file = arguments.folder / f"{number:03}.npz"
        if not file.exists():
            shape, beside = measured(template, person, number)
            np.savez(file, shape=shape, beside=beside)
    people = [np.load(arguments.folder / f"{n:03}.npz") for n in range(arguments.people)]
    found = learnt(np.stack([p["shape"] for p in people]), np.stack([p["beside"] for p in people]))
    rows = ",\n".join(f'"{name}": {json.dumps(row)}' for name, row in found.items())
    write_atomic(FILE, f'{{"landmarks": {{\n{rows}\n}}}}\n'.encode())


if __name__ == "__main__":
    main()
