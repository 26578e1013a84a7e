"""Lets a jumper hang with folds and weight, where a file's lies on the body like skin.

Points of the jumper's mesh fall until they rest on the body, held together by springs that are
longer than the mesh's edges: extended position-based dynamics, as in `fabric`. Arms are lowered
meanwhile, as people mostly hold them. What has settled is carried back to the rest pose, so that
folds move with the skeleton like all clothes. Cloth does not meet itself.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ico3d.splat.cpu.compile import kernel
from ico3d.studio.dress.fabric import GRAVITY, hold
from ico3d.studio.dress.tailoring import limb_axes, tailored
from ico3d.studio.person.edges import sides
from ico3d.studio.person.scatter import areas
from ico3d.studio.person.skeleton import Skeleton, turned
from ico3d.studio.person.subject import Material, Subject
from ico3d.studio.raster import vertex_normals

LOWERED = {
    "shoulder01": (0.0, 0.0, -4.0),
    "upperarm01": (8.0, 0.0, -20.0),
    "lowerarm01": (-10.0, 0.0, 5.0),
}
"""Rotations of the left arm's joints while cloth settles: degrees about X, Y, Z."""
SLEEVE = ("upperarm", "lowerarm", "wrist")
AROUND, ALONG = (0.08, 0.11), (0.03, 0.06)
"""How much longer cloth is than the body around it and along it, of trunk and of sleeves."""
ARMPIT, DEEP = 0.08, 0.06
"""Metres about the armpits in which cloth is cut close, and how far they lie below the joint."""
DENSITY = 0.35
"""Mass of knitted wool, kilograms per square metre."""
STRETCH, BEND = 1e-5, 3e-4
"""Compliances, metres per newton: of edges, and of springs over them, which hold the cloth flat."""
INSIDE, APART = 0.004, 0.002
"""Metres from the file's jumper inwards to the body, and least distance of cloth from that."""
FRICTION = 0.6
STEP, STEPS, LOOKS = 1 / 1200, 8, 150
"""Seconds of a step, steps between two looks for the nearest place of the body, number of looks."""
KEPT, CALM = 0.985, 0.95
"""Share of a velocity that a step leaves, and in the last fifth of the time."""
FASTEST = 0.8
"""Metres per second along each axis: cloth that falls faster would pass through a body."""
NEARBY = 160
"""Places of the body, of every second vertex, with which a point of cloth may meet."""
COARSEST = 0.011
"""Median length in metres of the edges from which on a mesh is too coarse for folds."""


def draped(subject: Subject) -> Subject:
    """The person in a jumper that hangs.

    Args:
        subject: A whole person at rest. One without a jumper, or whose jumper's mesh is too coarse
            to fold, stays as it is.
    """
    knit = subject.faces[subject.materials == Material.CLOTH]
    bones = subject.skeleton
    if len(knit) == 0 or bones is None:
        return subject
    edges = np.unique(sides(knit), axis=0)
    span = subject.vertices[edges[:, 0]] - subject.vertices[edges[:, 1]]
    if np.median(np.linalg.norm(span, axis=1)) > COARSEST:
        return subject
    worn = np.unique(knit)
    turn, shift = _lowered(bones)
    posed = np.einsum("vab,vb->va", turn, subject.vertices) + shift
    settled = _settled(subject, worn, np.searchsorted(worn, knit), posed)
    vertices = subject.vertices.copy()
    away = (settled - shift[worn])[..., None]  # (N, 3, 1)
    vertices[worn] = np.linalg.solve(turn[worn], away)[..., 0]
    return replace(subject, vertices=vertices, draped=True)


def _lowered(bones: Skeleton) -> tuple[np.ndarray, np.ndarray]:
    """What moves each vertex to the pose in which cloth settles: (V, 3, 3) and (V, 3)."""
    turns = np.tile(np.eye(3), (1, len(bones.names), 1, 1))
    for name, degrees in LOWERED.items():
        for side, mirror in (("L", 1), ("R", -1)):
            angles = np.radians(degrees) * (1, mirror, mirror)
            turns[0, bones.index(f"{name}.{side}")] = turned(angles[None])[0]
    mixed = bones.mixed(bones.matrices(turns, np.zeros((1, 3)))[0])  # (V, 3, 4)
    return mixed[..., :3], mixed[..., 3]


def _settled(
    subject: Subject, worn: np.ndarray, faces: np.ndarray, posed: np.ndarray
) -> np.ndarray:
    """(N, 3) float64 where the worn (N,) vertices come to rest among posed ones (V, 3)."""
    normals = vertex_normals(posed.astype(np.float32), subject.faces)
    hem = tailored(subject).fields[worn, 3]
    garments = np.isin(subject.materials, (Material.CLOTH, Material.TROUSERS))
    met = np.unique(subject.faces[garments])[::2]
    near = KDTree(subject.vertices[met]).query(subject.vertices[worn], min(NEARBY, len(met)))[1]
    normal = normals[met].astype(np.float64)
    body = posed[met] - INSIDE * normal
    pairs, lengths, compliance = _springs(subject, worn, faces, hem)
    masses = _masses(posed[worn], faces)
    inverse = np.where(hem < 0.9, 0.0, 1 / masses)  # ribs at the edges hold on to the body
    state = posed[worn] + APART * normals[worn] * np.clip(hem - 1, 0, 1)[:, None]
    velocity = np.zeros_like(state)
    for look in range(LOOKS):
        places = _nearest(state, near, body)
        kept = KEPT if look < 0.8 * LOOKS else CALM
        springs = pairs, lengths, compliance
        _fall(state, velocity, inverse, *springs, body[places], normal[places], kept)
    return state


def _masses(places: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N,) kilograms of cloth about each of the places (N, 3)."""
    third = areas(places[faces]) / 6  # (F,) of a triangle, to each of its corners
    share = np.bincount(faces.ravel(), np.repeat(third, 3), len(places))
    return DENSITY * np.maximum(share, 1e-7)


def _springs(
    subject: Subject, worn: np.ndarray, faces: np.ndarray, hem: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs (E, 2) int32 among worn (N,) vertices, their lengths and compliances (E,)."""
    edges, over = np.unique(sides(faces), axis=0), _over_edges(faces)
    pairs = np.concatenate([edges, over])
    first, second = subject.vertices[worn[pairs]].astype(float).transpose(1, 0, 2)
    span = second - first
    lengths = np.linalg.norm(span, axis=1)
    axis = limb_axes(subject)[0][worn[pairs[:, 0]]]
    along = ((span * axis).sum(1) / np.maximum(lengths, 1e-9)) ** 2  # (E,)
    sleeve, free = _sleeve(subject, worn), _free(subject, worn, hem)  # (N,) each
    arm = sleeve[pairs].mean(axis=1)
    wide, long = (ease[0] + (ease[1] - ease[0]) * arm for ease in (AROUND, ALONG))
    lengths *= 1 + free[pairs].mean(axis=1) * (wide + (long - wide) * along)
    compliance = np.repeat([STRETCH, BEND], [len(edges), len(over)])
    # One after the other along a row, springs would pass a pull on in one direction.
    order = np.random.default_rng(0).permutation(len(pairs))
    return pairs[order].astype(np.int32), lengths[order], compliance[order]


def _over_edges(faces: np.ndarray) -> np.ndarray:
    """(E, 2) the tips of each two triangles that share an edge."""
    edges, tips = sides(faces), faces[:, [2, 0, 1]].ravel()
    order = np.lexsort(edges.T)
    edges, tips = edges[order], tips[order]
    shared = (edges[1:] == edges[:-1]).all(axis=1)
    return np.stack([tips[:-1][shared], tips[1:][shared]], 1)


def _sleeve(subject: Subject, worn: np.ndarray) -> np.ndarray:
    """(N,) how much each worn vertex is of a sleeve, 0 to 1."""
    bones = subject.skeleton
    assert bones is not None  # draped
    columns = [i for i, name in enumerate(bones.names) if name.startswith(SLEEVE)]
    return bones.weights[worn][:, columns].sum(axis=1)


def _free(subject: Subject, worn: np.ndarray, hem: np.ndarray) -> np.ndarray:
    """(N,) 0 where cloth is cut as close as the file's, 1 where it is as loose as meant."""
    bones = subject.skeleton
    assert bones is not None  # draped
    pits = np.stack([bones.at[bones.index(f"upperarm01.{side}")] for side in "LR"])
    pits[:, 1] -= DEEP
    away = np.linalg.norm(subject.vertices[worn][:, None] - pits, axis=2).min(axis=1)
    return np.clip(hem - 1, 0, 1) * (1 - np.exp(-((away / ARMPIT) ** 2)))


@kernel(fast=False)
def _nearest(state, near, body):
    """(N,) int32 the nearest place of the body to each point, of those that may be met (N, K)."""
    found = np.empty(len(state), np.int32)
    for i in range(len(state)):
        least = 1e9
        for k in range(near.shape[1]):
            j = near[i, k]
            x, y, z = (
                state[i, 0] - body[j, 0],
                state[i, 1] - body[j, 1],
                state[i, 2] - body[j, 2],
            )
            away = x * x + y * y + z * z
            if away < least:
                least = away
                found[i] = j
    return found


@kernel(fast=False)
def _fall(state, velocity, inverse, pairs, lengths, compliance, body, normal, kept):
    """Some steps over the planes at body (N, 3) with unit normals (N, 3), in place."""
    for _ in range(STEPS):
        old = state.copy()
        for i in range(len(state)):
            if inverse[i] > 0.0:
                velocity[i, 1] -= GRAVITY * STEP
                for axis in range(3):
                    state[i, axis] += velocity[i, axis] * STEP
        hold(state, pairs, lengths, compliance, inverse, STEP)
        for i in range(len(state)):
            if inverse[i] > 0.0:
                _lift(state, old, body, normal, i)
            for axis in range(3):
                speed = kept * (state[i, axis] - old[i, axis]) / STEP
                velocity[i, axis] = min(FASTEST, max(-FASTEST, speed))


@kernel(fast=False)
def _lift(state, old, body, normal, i):
    """Lifts a point onto its plane, on which it slides with friction."""
    deep = APART
    for axis in range(3):
        deep -= (state[i, axis] - body[i, axis]) * normal[i, axis]
    if deep <= 0.0:
        return
    along = 0.0
    for axis in range(3):
        state[i, axis] += deep * normal[i, axis]
        along += (state[i, axis] - old[i, axis]) * normal[i, axis]
    slid = 0.0
    for axis in range(3):
        slid += (state[i, axis] - old[i, axis] - along * normal[i, axis]) ** 2
    held = min(1.0, FRICTION * deep / max(1e-12, np.sqrt(slid)))
    for axis in range(3):
        state[i, axis] -= held * (state[i, axis] - old[i, axis] - along * normal[i, axis])
