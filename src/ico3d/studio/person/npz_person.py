"""Reads a person from an `.npz` file: a head of ICT-FaceKit on a MakeHuman body.

The layout is described in `docs/captures/synthetic.md`, "Subject files".
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from ico3d.common.unpacking.npz import read_npz
from ico3d.errors import CaptureError
from ico3d.studio.person.bends import with_soft_bends
from ico3d.studio.person.edges import without_covered_neck
from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.smooth import smoothed
from ico3d.studio.person.subject import GARMENTS, Eye, Look, Material, Subject

MATERIAL_OF_PART = {
    "skin": Material.SKIN,
    "lips": Material.SKIN,
    "nails": Material.SKIN,
    "mouth_inside": Material.MOUTH,
    "eye_white": Material.EYE,
    "iris": Material.EYE,
    "pupil": Material.EYE,
    "eye_inner": Material.EYE,
    "teeth": Material.TEETH,
    "gums": Material.GUMS,
    "tongue": Material.TONGUE,
    "lashes": Material.LASH,
    "brows": Material.BROW,
    "hair": Material.HAIR,
    "shirt": Material.CLOTH,
}
MATERIAL_BELOW = {
    "trousers": Material.TROUSERS,
    "shoes": Material.SHOE,
    "socks": Material.SOCK,
}
"""Materials of garments that only a whole person wears."""
WORN = (Material.CLOTH, Material.TROUSERS)
"""What is split once more on a whole person."""
LARGEST = 1 << 28
"""Bytes of all arrays as numbers of 64 bits; 53 blendshapes of 27,000 vertices would take 34 MB."""
MOST_VERTICES = 1 << 19
"""Vertices that are read; the files have 44,000."""
MOST_SPLIT = 1 << 29
"""Bytes of what edges get of shapes and joints, were each of one triangle alone; the files have
0.37 of it. Garments are split twice, the second time into four times as many."""
MOST_NAMES = 1000
"""Shapes, joints and visemes."""
MOST_INFLUENCES = 16
"""Joints on which a vertex may hang."""
BUST_DEPTH = 0.55
"""Distance below the eyes at which a bust ends, metres; no camera of the head rig sees lower."""

LASH_CARDS = (0.0235, 0.1665, 0.122)
"""Lash cards in the texture: start of the first, distance between two, height of each."""
IRIS_SHOWN = 0.8
"""Visible share of the iris mesh's radius; the rest is covered by the white of the eye."""

RELAXED_ARMS = {
    "shoulder01.L": (0.0, 0.0, -6.0),
    "upperarm01.L": (8.0, 0.0, -30.0),
    "lowerarm01.L": (0.0, 0.0, 5.0),
    "shoulder01.R": (0.0, 0.0, 6.0),
    "upperarm01.R": (8.0, 0.0, 30.0),
    "lowerarm01.R": (0.0, 0.0, -5.0),
}
"""Rotations that lower the arms of the rest pose: degrees about X, Y, Z, X applied first."""

AWAKE = 0.25
"""Part of the shape that widens the eyes that a face at rest has: the files' lids hang low."""
LOWER_TEETH = 0.0016
"""Metres by which teeth lie lower than in the files, whose upper ones hide behind the lip."""
LOOKS = {
    "eyeLookUp": (-18.0, 0.0),
    "eyeLookDown": (22.0, 0.0),
    "eyeLookIn": (0.0, -26.0),
    "eyeLookOut": (0.0, 26.0),
}
"""Rotations of the left eyeball in degrees about X and Y; the files' shapes move the lids only."""

FAIR = Look(
    skin=(0.53, 0.312, 0.224),
    lips=(0.43, 0.170, 0.150),
    hair=(0.100, 0.054, 0.029),
    iris=(0.12, 0.17, 0.15),
    cloth=((0.50, 0.47, 0.42), (0.045, 0.10, 0.20)),
    stripes=False,
    freckles=0.55,
    jumper=(0.036, 0.086, 0.112),
    stubble=0.0,
)
TANNED = Look(
    skin=(0.42, 0.235, 0.155),
    lips=(0.36, 0.135, 0.11),
    hair=(0.020, 0.012, 0.008),
    iris=(0.13, 0.065, 0.03),
    cloth=((0.035, 0.10, 0.16), (0.40, 0.36, 0.28)),
    stripes=True,
    freckles=0.1,
    stubble=0.6,
)


def load_npz(path: Path, whole: bool = False) -> Subject:
    """Reads a person from a file.

    Args:
        path: The file.
        whole: True for the whole person with a skeleton, in the rest pose, False for a bust.

    Raises:
        CaptureError: If the file is missing, is not in npz format, or lacks an array.
    """
    if not os.path.isfile(path):
        raise CaptureError(f"there is no subject file {path}: name an .npz file, or 'anny'.")
    try:
        arrays = read_npz(path, LARGEST)
        _check_sizes(arrays)
        subject = without_covered_neck(_subject(path.stem, arrays, whole))
        coarse = (Material.HAIR, *GARMENTS) if whole else (Material.HAIR,)
        subject = smoothed(_with_turning_eyes(subject), np.isin(subject.materials, coarse))
        if not whole:
            return subject
        # Shade is found at vertices: those of a sleeve lay 16 mm apart.
        return smoothed(with_soft_bends(subject), np.isin(subject.materials, WORN), 0.0)
    except KeyError as error:
        raise CaptureError(f"the subject file {path} lacks the array {error}.") from error
    except (ValueError, OSError, IndexError) as error:
        raise CaptureError(f"the subject file {path} cannot be read: {error}.") from error


def _check_sizes(arrays: dict[str, np.ndarray]) -> None:
    """Refuses what would fill the memory: each shape and joint gets a row of all vertices.

    Where triangles are split, it gets one of all edges as well.

    Raises:
        ValueError: If there are too many.
    """
    vertices, shapes, joints = (len(arrays[n]) for n in ("verts", "bs_names", "joint_names"))
    if vertices > MOST_VERTICES or vertices * max(12 * shapes, 4 * joints) > LARGEST:
        raise ValueError(
            f"{shapes} shapes and {joints} joints of {vertices} vertices are more than is taken"
        )
    triangles = len(arrays["faces"]) + 4 * int(_worn(arrays).sum())
    if 3 * triangles * max(12 * shapes, 4 * joints) > MOST_SPLIT:
        raise ValueError(f"{shapes} shapes of {triangles} triangles are more than is taken")
    if max(shapes, joints, len(arrays["vis_names"])) > MOST_NAMES:
        raise ValueError(f"it has more than {MOST_NAMES} shapes, joints or visemes")
    shape = arrays["w_idx"].shape
    if len(shape) != 2 or shape != arrays["w_val"].shape or shape[1] > MOST_INFLUENCES:
        raise ValueError(f"its vertices hang on more than {MOST_INFLUENCES} joints each")


def _worn(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """(F,) which triangles are split twice on a whole person."""
    known = MATERIAL_OF_PART | MATERIAL_BELOW
    parts = [i for i, part in enumerate(arrays["part_names"]) if known.get(str(part)) in WORN]
    return np.isin(arrays["face_part"], parts)


def _subject(name: str, arrays: dict[str, np.ndarray], whole: bool) -> Subject:
    joints = {str(n): i for i, n in enumerate(arrays["joint_names"])}
    joint_at, tail_at = arrays["joint_pos"].astype(float), arrays["joint_tail"].astype(float)
    eye_left = joint_at[joints["eye.L"]]
    origin = np.array([0.0, eye_left[1], joint_at[joints["head"], 2]])
    known = MATERIAL_OF_PART | MATERIAL_BELOW if whole else MATERIAL_OF_PART
    kept = _kept_faces(arrays, known, 0.0 if whole else origin[1] - BUST_DEPTH)
    used, faces = np.unique(arrays["faces"][kept], return_inverse=True)
    shape = arrays["verts"].astype(float) if whole else _relaxed(arrays, joints)
    vertices = shape[used] - origin
    parts = [str(p) for p in arrays["part_names"]]
    materials = np.array([known.get(p, 255) for p in parts], np.uint8)
    names, moved, deltas = _blendshapes(arrays, used)
    _open_lids(vertices, names, moved, deltas)
    _lower_teeth(vertices, arrays, used)
    male = name.endswith("_m")
    return Subject(
        name=name,
        vertices=vertices.astype(np.float32),
        faces=faces.reshape(-1, 3).astype(np.int32),
        materials=materials[arrays["face_part"][kept]],
        corner_uv=_texture_coordinates(arrays, kept),
        lip_mask=arrays["lip_mask"][used].astype(np.float32),
        blendshape_names=names,
        delta_vertices=moved,
        deltas=deltas,
        visemes=_visemes(arrays, names),
        landmark_vertices=_positions_in(used, arrays["landmarks68"]),
        eyes=(
            _eye(arrays, joint_at[joints["eye.L"]], tail_at[joints["eye.L"]], origin),
            _eye(arrays, joint_at[joints["eye.R"]], tail_at[joints["eye.R"]], origin),
        ),
        neck_base=joint_at[joints["neck01"]] - origin,
        head_in_world=origin,
        male=male,
        look=TANNED if male else FAIR,
        sources=(
            "ICT-VGL/ICT-FaceKit, (c) 2020 USC Institute for Creative Technologies, MIT",
            "MakeHuman community assets, CC0 1.0",
        ),
        licence="MIT (keep ICT-FaceKit-LICENSE.txt) and CC0 1.0",
        skeleton=_skeleton(arrays, used, origin) if whole else None,
    )


def _open_lids(
    vertices: np.ndarray, names: tuple[str, ...], moved: np.ndarray, deltas: np.ndarray
) -> None:
    """Widens the eyes at rest, in place; lids that blink still close."""
    for side in ("Left", "Right"):
        if {f"eyeWide{side}", f"eyeBlink{side}"} <= set(names):
            wider = AWAKE * deltas[names.index(f"eyeWide{side}")]
            vertices[moved] += wider
            deltas[names.index(f"eyeBlink{side}")] -= wider


def _lower_teeth(vertices: np.ndarray, arrays: dict[str, np.ndarray], used: np.ndarray) -> None:
    """Moves both rows of teeth with their gums down, in place."""
    parts = [str(p) for p in arrays["part_names"]]
    rows = [parts.index(p) for p in ("teeth", "gums") if p in parts]
    on = np.unique(arrays["faces"][np.isin(arrays["face_part"], rows)])
    vertices[np.isin(used, on), 1] -= LOWER_TEETH


def _with_turning_eyes(subject: Subject) -> Subject:
    """The person whose gaze shapes turn the eyeballs, too."""
    ball = np.unique(subject.faces[subject.materials == Material.EYE])
    moved = np.union1d(subject.delta_vertices, ball).astype(np.int32)
    deltas = np.zeros((len(subject.deltas), len(moved), 3), np.float32)
    deltas[:, np.searchsorted(moved, subject.delta_vertices)] = subject.deltas
    for side, eye, sign in zip(("Left", "Right"), subject.eyes, (1, -1), strict=True):
        own = ball[np.sign(subject.vertices[ball, 0]) == sign]
        for name, (about_x, about_y) in LOOKS.items():
            if name + side not in subject.blendshape_names:
                continue
            row = subject.blendshape_names.index(name + side)
            turn = _rotation((about_x, sign * about_y, 0.0))
            change = (subject.vertices[own] - eye.centre) @ (turn - np.eye(3)).T
            deltas[row, np.searchsorted(moved, own)] = change
    return replace(subject, delta_vertices=moved, deltas=deltas)


def _kept_faces(
    arrays: dict[str, np.ndarray], known: dict[str, Material], lowest: float
) -> np.ndarray:
    """Indices of the faces that are drawn: shown by default, of a known part, high enough."""
    known_part = np.array([str(p) in known for p in arrays["part_names"]])
    height = arrays["verts"][:, 1][arrays["faces"]].max(axis=1)  # (F,)
    shown = ~arrays["face_hidden"] & known_part[arrays["face_part"]]
    return np.flatnonzero(shown & (height > lowest))


def _texture_coordinates(arrays: dict[str, np.ndarray], kept: np.ndarray) -> np.ndarray:
    """(F, 3, 2) float32 texture coordinates, rewritten where `Subject.corner_uv` says more."""
    uv = arrays["uv"][arrays["faces_uv"][kept]].astype(np.float32)
    parts = np.array([str(p) for p in arrays["part_names"]])[arrays["face_part"][kept]]
    lashes = parts == "lashes"
    for garment in ("shirt", *MATERIAL_BELOW):
        cloth = parts == garment
        if not cloth.any():
            continue
        corners = arrays["verts"][arrays["faces"][kept]][cloth]  # (F, 3, 3)
        length = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
        in_atlas = np.linalg.norm(uv[cloth, 1] - uv[cloth, 0], axis=1)
        uv[cloth] *= np.median(length / np.maximum(in_atlas, 1e-9))
    # Six cards lie above one another in the atlas, tips down, those of the lower lid below.
    card = (uv[lashes, :, 1] - LASH_CARDS[0]) / LASH_CARDS[1]  # (F, 3)
    index = np.floor(card.mean(axis=1, keepdims=True) + 0.1)
    uv[lashes, :, 0] += np.where(index < 3, 2.0, 0.0) - np.floor(uv[lashes, :, 0])
    uv[lashes, :, 1] = 1 - np.clip((card - index) * LASH_CARDS[1] / LASH_CARDS[2], 0, 1)
    return uv


def _skeleton(arrays: dict[str, np.ndarray], used: np.ndarray, origin: np.ndarray) -> Skeleton:
    """The joints, and how the `used` vertices hang on them; shoes are as stiff as their soles."""
    names = tuple(str(n) for n in arrays["joint_names"])
    weights = np.zeros((len(arrays["verts"]), len(names)), np.float32)
    rows = np.arange(len(weights))[:, None]
    np.add.at(weights, (rows, arrays["w_idx"]), arrays["w_val"].astype(np.float32))
    parts = [str(p) for p in arrays["part_names"]]
    shoes = np.unique(arrays["faces"][arrays["face_part"] == parts.index("shoes")])
    left = arrays["verts"][shoes, 0] > 0
    weights[shoes] = 0
    weights[shoes[left], names.index("foot.L")] = 1
    weights[shoes[~left], names.index("foot.R")] = 1
    return Skeleton(
        names,
        arrays["joint_parents"].astype(int),
        arrays["joint_pos"].astype(float) - origin,
        weights[used] / weights[used].sum(axis=1, keepdims=True),
    )


def _positions_in(used: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Where vertex indices went when only the sorted `used` ones were kept."""
    at = np.searchsorted(used, indices)
    if (used[np.minimum(at, len(used) - 1)] != indices).any():
        raise ValueError("a landmark lies on a vertex that is not drawn")
    return at.astype(np.int32)


def _rotation(degrees: tuple[float, float, float]) -> np.ndarray:
    """(3, 3) rotation about X, then Y, then Z."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def _relaxed(arrays: dict[str, np.ndarray], joints: dict[str, int]) -> np.ndarray:
    """(V, 3) float64 rest vertices with lowered arms, by linear blend skinning."""
    at = arrays["joint_pos"].astype(float)
    world = np.empty((len(joints), 4, 4))
    for name, j in joints.items():
        local = np.eye(4)
        local[:3, :3] = _rotation(RELAXED_ARMS.get(name, (0.0, 0.0, 0.0)))
        local[:3, 3] = at[j] - local[:3, :3] @ at[j]
        parent = int(arrays["joint_parents"][j])
        world[j] = local if parent < 0 else world[parent] @ local
    weights = arrays["w_val"].astype(float)
    weights /= weights.sum(axis=1, keepdims=True)
    matrices = np.zeros((len(weights), 4, 4))
    for share, joint in zip(weights.T, arrays["w_idx"].T, strict=True):  # (V,) each
        matrices += share[:, None, None] * world[joint]  # (V, 4, 4)
    vertices = arrays["verts"].astype(float)
    return np.einsum("vjk,vk->vj", matrices[:, :3, :3], vertices) + matrices[:, :3, 3]


def _arkit_name(name: str) -> str:
    """ARKit's name of an ICT shape; the two halves of `browInnerUp` are one ARKit shape."""
    if name.startswith("browInnerUp"):
        return "browInnerUp"
    return name.replace("_L", "Left").replace("_R", "Right")


def _blendshapes(
    arrays: dict[str, np.ndarray], used: np.ndarray
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """ARKit names (K), moved vertices (M,) among `used`, deltas (K, M, 3) float32."""
    names = tuple(dict.fromkeys(_arkit_name(str(n)) for n in arrays["bs_names"]))
    position = np.full(int(arrays["verts"].shape[0]), -1, np.int64)
    position[used] = np.arange(len(used))
    dense = np.zeros((len(names), len(used), 3), np.float32)
    for k, name in enumerate(arrays["bs_names"]):
        first, last = arrays["bs_ptr"][k : k + 2]
        at = position[arrays["bs_idx"][first:last]]
        dense[names.index(_arkit_name(str(name))), at[at >= 0]] += arrays["bs_delta"][first:last][
            at >= 0
        ]
    moved = np.flatnonzero(np.abs(dense).max(axis=(0, 2)) > 0).astype(np.int32)
    return names, moved, np.ascontiguousarray(dense[:, moved])


def _visemes(arrays: dict[str, np.ndarray], names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Viseme name to (K,) weights in the order of `names`."""
    columns = [names.index(_arkit_name(str(n))) for n in arrays["bs_names"]]
    visemes = {}
    for viseme, row in zip(arrays["vis_names"], arrays["vis_weights"], strict=True):
        weights = np.zeros(len(names), np.float32)
        np.maximum.at(weights, columns, row.astype(np.float32))
        visemes[str(viseme)] = weights
    return visemes


def _eye(arrays: dict[str, np.ndarray], centre: np.ndarray, tail: np.ndarray, origin) -> Eye:
    axis = (tail - centre) / np.linalg.norm(tail - centre)
    iris = arrays["face_part"] == [str(p) for p in arrays["part_names"]].index("iris")
    points = arrays["verts"][np.unique(arrays["faces"][iris])].astype(float) - centre
    points = points[points[:, 0] * np.sign(centre[0]) > -abs(centre[0])]  # this side only
    radius = float(np.linalg.norm(np.cross(points, axis), axis=1).max())
    return Eye(centre - origin, axis, IRIS_SHOWN * radius)
