"""A tiny whole person in the layout of the subject files: tubes on MakeHuman's joints."""

from pathlib import Path

import numpy as np

from support.recordings import synthetic_people

MIDDLE = [
    ("root", None, (0, 0.94, -0.05)),
    ("spine05", "root", (0, 0.95, 0)),
    ("spine04", "spine05", (0, 1.03, -0.03)),
    ("spine03", "spine04", (0, 1.10, -0.02)),
    ("spine02", "spine03", (0, 1.16, -0.03)),
    ("spine01", "spine02", (0, 1.25, -0.04)),
    ("neck01", "spine01", (0, 1.36, 0)),
    ("neck02", "neck01", (0, 1.39, 0)),
    ("neck03", "neck02", (0, 1.42, 0.01)),
    ("head", "neck03", (0, 1.46, 0.03)),
]
SIDES = [
    ("eye", "head", (0.03, 1.5, 0.09)),
    ("clavicle", "spine01", (0.02, 1.3, 0.02)),
    ("shoulder01", "clavicle", (0.11, 1.31, 0.02)),
    ("upperarm01", "shoulder01", (0.2, 1.27, 0.02)),
    ("upperarm02", "upperarm01", (0.24, 1.22, 0.018)),
    ("lowerarm01", "upperarm02", (0.36, 1.07, 0.012)),
    ("lowerarm02", "lowerarm01", (0.43, 1.0, 0.11)),
    ("wrist", "lowerarm02", (0.5, 0.93, 0.208)),
    ("pelvis", "root", (0, 0.95, 0)),
    ("upperleg01", "pelvis", (0.11, 0.94, 0)),
    ("lowerleg01", "upperleg01", (0.15, 0.53, 0.03)),
    ("foot", "lowerleg01", (0.2, 0.09, 0.01)),
    *(
        (
            f"finger{n}-{k}",
            f"finger{n}-{k - 1}" if k > 1 else "wrist",
            (
                0.5 + 0.012 * n - 0.03 * (n == 1),
                0.92 - 0.01 * n - 0.02 * k,
                0.3 - 0.02 * n + 0.02 * k,
            ),
        )
        for n in range(1, 6)
        for k in range(1, 4)
    ),
]
TUBES = [
    ("shirt", "spine02", (0, 0.93, 0), (0, 1.3, 0), 0.14),
    ("trousers", "root", (0, 0.85, 0), (0, 0.97, 0), 0.14),
]
SIDE_TUBES = [
    ("shirt", "upperarm01", "upperarm01", "lowerarm01", 0.05),
    ("shirt", "lowerarm01", "lowerarm01", "wrist", 0.04),
    ("skin", "wrist", "wrist", "finger3-3", 0.03),
    ("trousers", "upperleg01", "upperleg01", "lowerleg01", 0.08),
    ("trousers", "lowerleg01", "lowerleg01", "foot", 0.06),
]


def joints():
    """Names, parents, positions of the skeleton."""
    rows = [(name, parent, np.array(at, float)) for name, parent, at in MIDDLE]
    for side, sign in (("L", 1), ("R", -1)):
        for name, parent, at in SIDES:
            central = any(parent == row[0] for row in MIDDLE)
            above = parent if central else f"{parent}.{side}"
            rows.append((f"{name}.{side}", above, np.array(at, float) * (sign, 1, 1)))
    names = [name for name, _, _ in rows]
    parents = [names.index(parent) if parent else -1 for _, parent, _ in rows]
    return names, np.array(parents, np.int32), np.stack([at for _, _, at in rows])


def _tube(a, b, radius, sides=8):
    """Vertices and triangles of a closed tube."""
    along = (b - a) / np.linalg.norm(b - a)
    one = np.cross(along, (0.3, 0.1, 1.0))
    one /= np.linalg.norm(one)
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = radius * (np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * np.cross(along, one))
    vertices = np.concatenate([a + ring, b + ring, [a, b]])
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    first, last = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = [
        (i, j, i + sides),
        (j, j + sides, i + sides),
        (first, j, i),
        (last, i + sides, j + sides),
    ]
    return vertices, np.concatenate([np.stack(f, 1) for f in faces])


def _shoe(at, sign):
    """A box on the floor."""
    x, y, z = np.meshgrid([-0.04, 0.04], [0, 0.09], [-0.06, 0.18], indexing="ij")
    corners = np.stack([x.ravel() + sign * abs(at[0]), y.ravel(), z.ravel() + at[2]], 1)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def _pieces(names, at):
    """(part, joint, vertices, triangles) of everything below the head."""
    place = dict(zip(names, at, strict=True))
    for part, joint, a, b, radius in TUBES:
        yield part, joint, *_tube(np.array(a, float), np.array(b, float), radius)
    for side, sign in (("L", 1), ("R", -1)):
        for part, joint, a, b, radius in SIDE_TUBES:
            ends = place[f"{a}.{side}"], place[f"{b}.{side}"]
            yield part, f"{joint}.{side}", *_tube(*ends, radius)
        yield "shoes", f"foot.{side}", *_shoe(place[f"foot.{side}"], sign)


def write_body(path: Path) -> Path:
    """Writes a whole person with the block head of `synthetic_people`."""
    synthetic_people.write_person(path)
    with np.load(path) as archive:
        head = {name: archive[name] for name in archive.files}
    names, parents, at = joints()
    # The block person's own shirt hangs 0.3 m below its eyes: the tubes replace it.
    kept = head["face_part"] != synthetic_people.PARTS.index("shirt")
    vertices, faces, parts = [head["verts"]], [head["faces"][kept]], [head["face_part"][kept]]
    bound = [np.full(len(head["verts"]), names.index("head"))]
    for part, joint, points, triangles in _pieces(names, at):
        faces.append(triangles + sum(map(len, vertices)))
        vertices.append(points)
        parts.append(np.full(len(triangles), synthetic_people.PARTS.index(part), np.uint8))
        bound.append(np.full(len(points), names.index(joint)))
    verts, tris = np.concatenate(vertices), np.concatenate(faces)
    index = np.zeros((len(verts), 4), np.uint8)
    index[:, 0] = np.concatenate(bound)
    return synthetic_people.write_person(
        path,
        verts=verts.astype(np.float32),
        faces=tris.astype(np.int32),
        faces_uv=tris.astype(np.int32),
        uv=verts[:, :2].astype(np.float32),
        face_part=np.concatenate(parts).astype(np.uint8),
        face_hidden=np.zeros(len(tris), bool),
        lip_mask=np.zeros(len(verts), np.float16),
        joint_names=np.array(names),
        joint_parents=parents,
        joint_pos=at.astype(np.float32),
        joint_tail=(at + np.array([0, 0, 0.01])).astype(np.float32),
        w_idx=index,
        w_val=np.tile(np.array([1, 0, 0, 0], np.float16), (len(verts), 1)),
    )
