"""Where clothes have finished edges, seams and folds: values per vertex for cloth's relief."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ico3d.studio.person.edges import open_loops, sides
from ico3d.studio.person.subject import Material, Subject

COLLAR_RIB, HEM_RIB, LEG_HEM = 0.026, 0.055, 0.022
"""Widths of the ribbed collar, of ribbed cuffs and hem, and of a trouser leg's hem, metres."""
RIB = 0.0055
"""Width of a rib, metres."""
FOLD, FOLD_ACROSS = 0.066, 0.080
"""Distance of folds along a limb, and their length across it, metres."""
LOOSE = 0.0009
"""Depth in metres of folds where nothing pushes cloth together."""
DEEPEST = 0.009
"""Depth of the deepest folds, metres."""
PUSHED = 0.035
"""Depth in metres of folds where a limb's cloth has lost its whole length."""
EVEN = 1.9
"""Squeeze of the pattern of folds, as a multiple of what is meant, from which cloth has none."""
ARM = ("clavicle", "shoulder", "upperarm", "lowerarm", "wrist")
FAR = 9.0
SLANT = 0.55
"""How far folds of a jumper rise with the distance from the middle."""


@dataclass(frozen=True)
class Tailored:
    """Clothes of one person, ready for the shader.

    Attributes:
        corner_uv: (F, 3, 2) float32 texture coordinates; on knitwear, u is 0 in the middle of each
            panel.
        fields: (V, 8) float32: place in the pattern of folds (3); distance from the nearest
            finished edge in widths of its hem; cosine and sine of the turn about that edge; number
            of ribs around it; distance from the nearest seam, metres.
        loose: (V,) float32 depth of the folds at rest, metres.
        edges: (E, 2) int edges of the clothes.
        lengths: (E,) their lengths at rest, metres.
        along: (E,) how much each runs along its limb, 0 to 1.
    """

    corner_uv: np.ndarray
    fields: np.ndarray
    loose: np.ndarray
    edges: np.ndarray
    lengths: np.ndarray
    along: np.ndarray

    def folds(self, vertices: np.ndarray) -> np.ndarray:
        """(V,) float32 depth of the folds of a pose in metres: deeper where cloth is pushed.

        Args:
            vertices: (V, 3) posed vertices, metres.
        """
        count = len(vertices)
        a, b = self.edges.T
        now = np.linalg.norm(vertices[a] - vertices[b], axis=1)  # (E,)
        lost = np.maximum(1 - now / self.lengths, 0) * self.along
        total = np.bincount(a, lost, count) + np.bincount(b, lost, count)
        weight = np.bincount(a, self.along, count) + np.bincount(b, self.along, count)
        pushed = total / np.maximum(weight, 1e-9)  # (V,)
        degree = np.maximum(np.bincount(a, minlength=count) + np.bincount(b, minlength=count), 1)
        for _ in range(3):  # a fold is longer than a thread
            around = np.bincount(a, pushed[b], count) + np.bincount(b, pushed[a], count)
            pushed = 0.4 * pushed + 0.6 * around / degree
        free = np.minimum(self.loose / (0.5 * LOOSE), 1)  # (V,)
        depth = self.loose * (1 + 3 * pushed) + PUSHED * pushed * free
        return np.minimum(depth, DEEPEST).astype(np.float32)


def tailored(subject: Subject) -> Tailored:
    """Finds edges, seams and folds of a person's clothes."""
    clothes = np.isin(subject.materials, (Material.CLOTH, Material.TROUSERS))
    faces = subject.faces[clothes]
    edges = np.unique(sides(faces), axis=0)
    places, axis = _fold_places(subject)
    span = subject.vertices[edges[:, 1]] - subject.vertices[edges[:, 0]]  # (E, 3)
    lengths = np.maximum(np.linalg.norm(span, axis=1), 1e-6)
    along = ((span * axis[edges[:, 0]]).sum(1) / lengths) ** 2
    fields = np.zeros((len(subject.vertices), 8))
    fields[:, :3] = places
    fields[:, 3] = fields[:, 7] = FAR
    for material, hems in ((Material.CLOTH, None), (Material.TROUSERS, LEG_HEM)):
        _hem(subject, material, hems, fields)
    uv = _centred(subject)
    _seams(subject, uv, fields)
    return Tailored(
        uv,
        fields.astype(np.float32),
        (_loose(subject, fields) * _even(places, edges, lengths)).astype(np.float32),
        edges,
        lengths,
        along,
    )


def limb_axes(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) unit direction of each vertex's limb, and (V, 3) the shoulder on its side."""
    up = np.tile([0.0, 1.0, 0.0], (len(subject.vertices), 1))
    centre, bones = np.zeros_like(up), subject.skeleton
    if bones is None:
        return up, centre
    for side in "LR":
        columns = [i for i, n in enumerate(bones.names) if n.startswith(ARM) and n.endswith(side)]
        side_of = subject.vertices[:, :1] > 0 if side == "L" else subject.vertices[:, :1] <= 0
        share = np.clip(2 * bones.weights[:, columns].sum(axis=1, keepdims=True) - 0.6, 0, 1)
        start, end = bones.at[[bones.index(f"{n}.{side}") for n in ("upperarm01", "wrist")]]
        arm = (start - end) / np.linalg.norm(start - end)
        up, centre = up + share * (arm - up), np.where(side_of, start, centre)
    return up / np.linalg.norm(up, axis=1, keepdims=True), centre


def _fold_places(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """Places in a pattern of folds, (V, 3): across, along and across; and limbs' axes (V, 3)."""
    vertices, (axis, centre) = subject.vertices, limb_axes(subject)
    knit = np.zeros(len(vertices))
    knit[subject.faces[subject.materials == Material.CLOTH]] = 1
    along = ((vertices - centre) * axis).sum(axis=1)  # (V,)
    # On the trunk, cloth hangs in folds that slant from the armpits to the middle.
    along -= SLANT * axis[:, 1] ** 2 * np.hypot(vertices[:, 0], 0.04) * knit
    places = np.stack([vertices[:, 0], along, vertices[:, 2]], 1)
    return places / [FOLD_ACROSS, FOLD, FOLD_ACROSS], axis


def _even(places: np.ndarray, edges: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """(V,) 1 where the pattern of folds is as long as meant, 0 where it is squeezed.

    Between trunk and arm the pattern turns within centimetres; folds there would be sharp creases.
    """
    (a, b), count = edges.T, len(places)
    rate = np.abs(places[a, 1] - places[b, 1]) * FOLD / lengths  # (E,)
    most = np.zeros(count)
    np.maximum.at(most, a, rate)
    np.maximum.at(most, b, rate)
    even = np.clip((EVEN - most) / (0.4 * EVEN), 0, 1)  # (V,)
    degree = np.maximum(np.bincount(a, minlength=count) + np.bincount(b, minlength=count), 1)
    for _ in range(3):
        around = np.bincount(a, even[b], count) + np.bincount(b, even[a], count)
        even = np.minimum(even, around / degree)
    return even


def _finished_edges(subject: Subject, material: Material) -> list[np.ndarray]:
    """Vertices (N,) of each finished edge of a garment; where a bust is cut off is none."""
    loops = open_loops(subject, material)
    if subject.skeleton is not None:
        return loops
    floor = subject.vertices[:, 1].min() + 0.08
    return [loop for loop in loops if subject.vertices[loop, 1].min() > floor]


def _hem(subject: Subject, material: Material, width: float | None, fields: np.ndarray) -> None:
    """Writes distance, turn and ribs of the nearest finished edge of a garment into fields."""
    worn = np.unique(subject.faces[subject.materials == material])
    points = subject.vertices[worn]
    for loop in _finished_edges(subject, material):
        edge = subject.vertices[loop]
        middle = edge.mean(axis=0)
        high = middle[1] > points[:, 1].max() - 0.06
        if width is not None and high:
            continue  # a waistband lies under a jumper
        broad = width or (COLLAR_RIB if high else HEM_RIB)
        away = KDTree(edge).query(points)[0] / broad  # (P,)
        first, second = np.linalg.svd(edge - middle, full_matrices=False)[2][:2]
        flat = np.stack([(points - middle) @ first, (points - middle) @ second], 1)  # (P, 2)
        around = 2 * np.pi * np.linalg.norm(edge - middle, axis=1).mean()
        nearer = away < fields[worn, 3]
        at = worn[nearer]
        turn = flat[nearer] / np.maximum(np.linalg.norm(flat[nearer], axis=1, keepdims=True), 1e-6)
        fields[at, 3], fields[at, 4:6] = away[nearer], turn
        fields[at, 6] = round(around / RIB)


def _centred(subject: Subject) -> np.ndarray:
    """(F, 3, 2) texture coordinates, those of each panel of knitwear about its middle."""
    uv = subject.corner_uv.copy()
    knit = np.flatnonzero(subject.materials == Material.CLOTH)
    if len(knit) == 0 or subject.skeleton is None:
        return uv
    for panel in _panels(uv[knit]):
        chosen = knit[panel]
        corners = uv[chosen, :, 0].ravel()
        x = np.abs(subject.vertices[subject.faces[chosen], 0]).ravel()
        middle = corners[x < 0.01] if (x < 0.01).any() else corners
        uv[chosen, :, 0] -= 0.5 * (middle.min() + middle.max())
    return uv


def _panels(uv: np.ndarray) -> list[np.ndarray]:
    """Faces of each connected part of texture coordinates (F, 3, 2)."""
    places = np.round(uv.reshape(-1, 2) * 2e4).astype(np.int64)
    index = np.unique(places, axis=0, return_inverse=True)[1].reshape(-1, 3)
    pairs = index[:, [0, 1, 1, 2]].reshape(-1, 2)
    graph = coo_matrix((np.ones(len(pairs)), tuple(pairs.T)), shape=(index.max() + 1,) * 2)
    label = connected_components(graph, directed=False)[1][index[:, 0]]
    return [np.flatnonzero(label == n) for n in np.unique(label)]


def _seams(subject: Subject, uv: np.ndarray, fields: np.ndarray) -> None:
    """Writes the distance from borders between a garment's panels into fields."""
    for material in (Material.CLOTH, Material.TROUSERS):
        chosen = np.flatnonzero(subject.materials == material)
        if len(chosen) == 0 or subject.skeleton is None:
            continue
        panels = _panels(subject.corner_uv[chosen])
        owner = np.zeros(len(subject.vertices), int)
        for panel in panels:
            owner[np.unique(subject.faces[chosen[panel]])] += 1
        seam = np.flatnonzero(owner > 1)
        worn = np.unique(subject.faces[chosen])
        if len(seam):
            fields[worn, 7] = KDTree(subject.vertices[seam]).query(subject.vertices[worn])[0]


def _loose(subject: Subject, fields: np.ndarray) -> np.ndarray:
    """(V,) depth of folds at rest: none in ribs, most where limbs bend and above hems."""
    depth = np.zeros(len(subject.vertices))
    knit = np.unique(subject.faces[subject.materials == Material.CLOTH])
    legs = np.unique(subject.faces[subject.materials == Material.TROUSERS])
    at, hem = subject.vertices, fields[:, 3]
    depth[knit], depth[legs] = LOOSE, 0.5 * LOOSE
    above = np.exp(-(((hem - 2.0) / 0.8) ** 2))  # cloth gathers over the rib that holds it
    depth[knit] += 0.003 * above[knit]
    depth[legs] += 0.0045 * np.exp(-((hem[legs] / 3.5) ** 2))
    bones = subject.skeleton
    if bones is not None:
        for joint, chosen, deep, wide in (
            ("lowerarm01", knit, 0.004, 0.06),
            ("upperarm01", knit, 0.0035, 0.09),
            ("lowerleg01", legs, 0.0035, 0.07),
            ("upperleg01", legs, 0.0035, 0.09),
        ):
            for side in "LR":
                away = at[chosen] - bones.at[bones.index(f"{joint}.{side}")]
                depth[chosen] += deep * np.exp(-((away**2).sum(axis=1)) / (2 * wide**2))
    ribbed = np.clip(hem[knit] - 0.8, 0, 1)
    depth[knit] *= 0.0 if subject.draped else ribbed  # a draped jumper has folds of its own
    return depth
