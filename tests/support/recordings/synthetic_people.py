"""A tiny person in the layout of the subject files: a block head that can open its mouth."""

from pathlib import Path

import numpy as np

from ico3d.studio.recording import Recording

PARTS = [
    "skin",
    "lips",
    "mouth_inside",
    "nails",
    "eye_white",
    "iris",
    "pupil",
    "cornea",
    "eye_inner",
    "eye_fluid",
    "eye_occlusion",
    "teeth",
    "gums",
    "tongue",
    "lashes",
    "brows",
    "hair",
    "shirt",
    "trousers",
    "shoes",
    "socks",
]
SHAPES = ["jawOpen", "eyeBlink_L", "eyeBlink_R", "browInnerUp_L", "browInnerUp_R"]
VISEMES = ["sil", "PP", "FF", "TH", "DD", "kk", "CH", "SS", "nn", "RR", "aa", "E", "ih", "oh", "ou"]
JAW = {"aa": 0.5, "E": 0.3, "ih": 0.2, "oh": 0.4, "ou": 0.15, "DD": 0.15, "nn": 0.12, "kk": 0.2}
EYE_HEIGHT = 1.5


def _grid(rows, columns, surface):
    """Vertices of a grid in [-1, 1]², laid on a surface, and its triangles."""
    u, v = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return surface(u.ravel(), v.ravel()), faces


def _pieces():
    """(part, item surface) of a face, two eyes, hair and a shirt."""
    yield "skin", lambda u, v: np.stack([0.08 * u, 0.12 * v, 0.1 - 0.04 * u * u], 1)
    for side in (1, -1):
        yield (
            "eye_white",
            lambda u, v, s=side: np.stack([0.03 * s + 0.01 * u, 0.01 * v, 0.105 + 0 * u], 1),
        )
        yield (
            "iris",
            lambda u, v, s=side: np.stack([0.03 * s + 0.006 * u, 0.006 * v, 0.106 + 0 * u], 1),
        )
    yield "hair", lambda u, v: np.stack([0.09 * u, 0.13 + 0.03 * v, 0.09 - 0.04 * u * u], 1)
    yield "shirt", lambda u, v: np.stack([0.3 * u, -0.32 + 0.2 * v, 0.06 - 0.1 * u * u], 1)


def write_person(path: Path, **changes) -> Path:
    """Writes a person; `changes` replace arrays, None leaves one out."""
    vertices, faces, parts = [], [], []
    for part, surface in _pieces():
        points, triangles = _grid(9, 9, surface)
        faces.append(triangles + sum(map(len, vertices)))
        vertices.append(points + np.array([0, EYE_HEIGHT, 0]))
        parts.append(np.full(len(triangles), PARTS.index(part), np.uint8))
    verts, tris = np.concatenate(vertices), np.concatenate(faces)
    landmarks = np.arange(68, dtype=np.int32) % 81
    upper, lower = 4 + 9 * 2, 4 + 9 * 1  # face column 4: the lips' middle, rows 2 and 1
    landmarks[[61, 62, 63]], landmarks[[65, 66, 67]] = upper, lower
    jaw = np.flatnonzero(verts[:81, 1] < verts[lower, 1] + 1e-6)
    moved = [jaw, [10], [11], [12], [13]]
    arrays = {
        "verts": verts.astype(np.float32),
        "faces": tris.astype(np.int32),
        "faces_uv": tris.astype(np.int32),
        "uv": verts[:, :2].astype(np.float32),
        "face_part": np.concatenate(parts),
        "part_names": np.array(PARTS),
        "face_hidden": np.zeros(len(tris), bool),
        "bs_names": np.array(SHAPES),
        "bs_ptr": np.cumsum([0, *map(len, moved)]).astype(np.int32),
        "bs_idx": np.concatenate(moved).astype(np.int32),
        "bs_delta": np.tile(np.array([0, -0.03, 0], np.float16), (sum(map(len, moved)), 1)),
        "vis_names": np.array(VISEMES),
        "vis_weights": np.array([[JAW.get(v, 0), 0, 0, 0, 0] for v in VISEMES], np.float32),
        "lip_mask": np.zeros(len(verts), np.float16),
        "landmarks68": landmarks,
        "joint_names": np.array(["head", "neck01", "eye.L", "eye.R"]),
        "joint_parents": np.array([-1, 0, 0, 0], np.int32),
        "joint_pos": np.array(
            [[0, 1.46, 0.03], [0, 1.36, 0], [0.03, 1.5, 0.09], [-0.03, 1.5, 0.09]], np.float32
        ),
        "joint_tail": np.array(
            [[0, 1.6, 0.03], [0, 1.4, 0], [0.03, 1.5, 0.1], [-0.03, 1.5, 0.1]], np.float32
        ),
        "w_idx": np.zeros((len(verts), 4), np.uint8),
        "w_val": np.tile(np.array([1, 0, 0, 0], np.float16), (len(verts), 1)),
    } | changes
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    return path


def small_recording(subject: Path, **changes) -> Recording:
    """A recording of a head that takes a moment."""
    values = dict(rig="head", cameras=3, frames=11, views_per_frame=1, size=40, text="", seed=3)
    values |= dict(lively=False, fps=25.0, light="studio", motion="talk")
    return Recording(str(subject), **(values | changes))
