"""Writes SMPL-X model files in the published layout, with few random vertices, and parameters."""

from pathlib import Path

import h5py
import numpy as np

from support.rigs import rig_of

PARENTS = (
    *(-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15),
    *(20, 25, 26, 20, 28, 29, 20, 31, 32, 20, 34, 35, 20, 37, 38),
    *(21, 40, 41, 21, 43, 44, 21, 46, 47, 21, 49, 50, 21, 52, 53),
)
"""Parents of the joints as published."""
FINGERS = ("index", "middle", "pinky", "ring", "thumb")
NAMES = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar"),
    *("right_collar", "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
    *("left_wrist", "right_wrist", "jaw", "left_eye_smplhf", "right_eye_smplhf"),
    *(f"{side}_{finger}{n}" for side in ("left", "right") for finger in FINGERS for n in (1, 2, 3)),
)
"""Names of the joints as published."""
OTHERS = {
    "left_foot": (0.13, 0.02, 0.12),
    "right_foot": (-0.13, 0.02, 0.12),
    "jaw": (0, 1.5, 0.06),
    "left_eye_smplhf": (0.03, 1.58, 0.09),
    "right_eye_smplhf": (-0.03, 1.58, 0.09),
}
"""Joints that play no role in gestures."""


def model_arrays(seed: int = 3, influences: int = 4) -> dict[str, np.ndarray]:
    """The arrays of a model whose joints are a person's with spread arms.

    Args:
        seed: Of the random numbers.
        influences: Number of joints that carry a vertex.
    """
    random = np.random.default_rng(seed)
    rig = rig_of("SMPL-X", 0.0)
    places = dict(zip(rig.names, rig.joints, strict=True)) | OTHERS
    joints = np.array([places[name] for name in NAMES]) - (0, 1.2, 0)
    around = joints[random.integers(0, 55, 25)] + random.normal(0, 0.05, (25, 3))
    vertices = np.concatenate([joints, around])  # (80, 3)
    weights = np.zeros((80, 55))
    for row in weights:
        row[random.choice(55, influences, replace=False)] = random.dirichlet(np.ones(influences))
    table = np.stack([np.array(PARENTS).astype(np.uint32), np.arange(55, dtype=np.uint32)])
    named = {name: number for number, name in enumerate(NAMES)}
    return {
        "v_template": vertices,
        "shapedirs": random.normal(0, 0.003, (80, 3, 400)),
        "posedirs": random.normal(0, 0.1, (80, 3, 486)),
        "J_regressor": 0.9 * np.eye(55, 80) + 0.1 * random.dirichlet(np.ones(80), 55),
        "weights": weights,
        "kintree_table": table,
        "f": random.integers(0, 80, (150, 3)).astype(np.uint32),
        "hands_meanl": random.normal(0, 0.3, 45),
        "hands_meanr": random.normal(0, 0.3, 45),
        "joint2num": np.array(named, dtype=object),  # pickled, as in the published files
    }


def write_model(file: Path, arrays: dict[str, np.ndarray] | None = None) -> Path:
    """Writes a model file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("wb") as stream:
        np.savez(stream, allow_pickle=True, **(arrays or model_arrays()))
    return file


def parameters(frames: int, seed: int = 5) -> dict[str, np.ndarray]:
    """Parameters of one person who moves; every frame has the same shape and expression."""
    random = np.random.default_rng(seed)
    return {
        "betas": np.tile(random.normal(size=10), (frames, 1)),
        "expression": np.tile(random.normal(size=10), (frames, 1)),
        "fullpose": random.normal(0, 0.4, (frames, 55, 3)),
        "transl": random.normal(0, 0.5, (frames, 3)),
        "scale": np.array(1.02),
    }


def write_parameters(main: Path, parts: dict[str, np.ndarray]) -> None:
    """Replaces parameters in the annotations beside a recording's main file."""
    with h5py.File(main.with_stem(f"{main.stem}_annots"), "a") as file:
        for name, values in parts.items():
            del file[f"SMPLx/{name}"]
            file[f"SMPLx/{name}"] = values
