"""The template's surface against the masks: clothes and hair stand off it, by always the same."""

import numpy as np
from scipy.spatial import KDTree

from ico3d.capture.posing.fitting.body import Body, Kinematics, Posed, mixed
from ico3d.capture.posing.fitting.rows import Rows
from ico3d.capture.posing.model.template import Template
from ico3d.capture.posing.seeing.outlines import Outlines
from ico3d.common.camera import Camera

COARSE, FINE = 0.03, 0.012
"""Metres between the looked-at points of the surface: anywhere, and on hands."""
CAMERAS_AT_ONCE = 6
"""Cameras whose outlines a step looks at."""
AHEAD = 0.03
"""Metres off the rim where nothing else of the body may be seen: else there is no outline."""
RIM = 0.3
"""Cosine between normal and line of sight below which a point may lie on the outline."""
STRAY, CUT_OFF = 0.010, 0.04
"""Metres: an outline is met as well as that, and one that is farther off is another's."""
CLOTHES, HAIR, SKIN = (0.012, 0.015), (0.0, 0.015), (0.0, 0.0015)
"""Metres that clothes, hair, and skin of hands usually stand off the template, and their spread."""
SMOOTH = 0.012
"""Metres by which neighbouring nodes usually differ in it."""
APART, NEIGHBOURS = 0.08, 6
"""Metres between nodes that know what stands off, and how many neighbours each has."""
MIXED = 4
"""Nodes between which a point's stand-off lies."""
SAY = 0.06
"""Part of what a point of the rim says that counts: its neighbours say the same."""
HAND, HEAD = ("wrist", "metacarpal", "finger"), ("neck", "head")


class Surface:
    """Points of the template's surface that are compared with outlines: a `Term`."""

    def __init__(self, kinematics: Kinematics, outlines: Outlines, frames: np.ndarray, seed: int):
        """Chooses points about evenly.

        Args:
            kinematics: Of the template.
            outlines: Of the recording.
            frames: (F,) numbers in the recording of the fit's frames.
            seed: Decides which cameras are looked at in which step.
        """
        template = kinematics.template
        rest, binding = template.vertices[0], template.binding
        strongest = binding.joints[np.arange(len(rest)), binding.weights.argmax(1)]
        hands = [j for j, name in enumerate(template.names) if name.startswith(HAND)]
        in_hand = np.isin(strongest, hands)
        coarse, fine = np.flatnonzero(~in_hand), np.flatnonzero(in_hand)
        chosen = np.append(coarse[_thinned(rest[coarse], COARSE)], fine[_thinned(rest[fine], FINE)])
        self._template: Template = template
        self._outlines, self._frames = outlines, frames
        self._random = np.random.default_rng(seed)
        self._chosen = chosen
        self._points = template.vertices[:, chosen]  # (1 + K, S, 3)
        self._basis = self._points[1:].transpose(1, 2, 0).copy()  # (S, 3, K)
        self._normals = vertex_normals(rest, template.faces)[chosen]
        self._weights = binding.dense(len(template.names))[chosen].astype(float)  # (S, J)
        self.carried = self._weights @ kinematics.below.astype(float)  # (S, J)
        nodes = chosen[_thinned(rest[chosen], APART)]
        self._tree = KDTree(rest[nodes])
        self._nodes = self._between(rest[chosen])  # (S, M)
        self.usual, spread = self._clothed([template.names[j] for j in strongest[nodes]])
        self.information = self._smoothness(rest[nodes], spread)

    def _between(self, points: np.ndarray) -> np.ndarray:
        """(N, M) parts that nodes have in points (N, 3) of the mean shape."""
        away, near = self._tree.query(points, MIXED)
        parts = 1 / np.maximum(away, 0.01) ** 2  # (N, 4)
        weights = np.zeros((len(points), self._tree.n))
        np.put_along_axis(weights, np.asarray(near), parts / parts.sum(1, keepdims=True), 1)
        return weights

    @staticmethod
    def _clothed(carriers: list[str]) -> np.ndarray:
        """(2, M) metres that nodes usually stand off and their spread, by the joints' names."""
        kinds = [
            SKIN if name.startswith(HAND) else HAIR if name.startswith(HEAD) else CLOTHES
            for name in carriers
        ]
        return np.array(kinds).T

    def _smoothness(self, nodes: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """(M, M) inverse covariance of what stands off: little, and much as its neighbours."""
        near = np.asarray(self._tree.query(nodes, NEIGHBOURS + 1)[1])[:, 1:]  # (M, 6)
        rows, edges = np.repeat(np.arange(len(nodes)), NEIGHBOURS), np.arange(near.size)
        differ = np.zeros((len(edges), len(nodes)))
        differ[edges, rows], differ[edges, near.ravel()] = 1, -1
        return differ.T @ differ / SMOOTH**2 / 2 + np.diag(1 / spread**2)

    def rows(self, body: Body, posed: Posed, frame: int) -> Rows:
        """An equation for each point that is beyond a mask, or on the rim in a camera."""
        number = int(self._frames[frame])
        known = np.flatnonzero(self._outlines.known[number])
        looked = self._random.permutation(known)[:CAMERAS_AT_ONCE]
        points, normals = self.skinned(body, posed)
        found = [self._seen(int(camera), number, points, normals) for camera in looked]
        if not found:
            nothing = np.zeros((0, 3))
            return Rows(nothing, nothing, nothing[:, 0], nothing[:, 0], np.zeros(0, int))
        ways, missing, weights, numbers = (
            np.concatenate(part) for part in zip(*found, strict=True)
        )
        share = SAY * len(known) / len(looked) * min(1.0, CAMERAS_AT_ONCE / len(known))
        return Rows(points[numbers], ways, missing, weights * share, numbers)

    def _seen(
        self, camera: int, number: int, points: np.ndarray, normals: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Ways, missing metres, weights and points' numbers in one camera."""
        lens = self._outlines.cameras[camera]
        pixels, depths = lens.project(points)
        inside, slope = self._outlines.at(camera, number, pixels)  # (S,), (S, 2)
        focal = lens.intrinsics[[0, 1], [0, 1]]
        metres = inside * depths / focal[0]
        sight = points - lens.camera_to_world[:3, 3]
        sight /= np.linalg.norm(sight, axis=1, keepdims=True)
        rim = np.abs((sight * normals).sum(1)) < RIM
        rim[rim] = _outermost(lens, pixels, points[rim] + AHEAD * normals[rim])
        with np.errstate(invalid="ignore"):
            used = np.isfinite(metres) & (depths > 0.05) & (rim | (metres < 0))
        off = np.where(used, metres, 0.0) / STRAY
        border = 1 / (1 + (off * STRAY / CUT_OFF) ** 2) ** 2  # Geman and McClure
        pulled = 1 / np.sqrt(1 + off**2)  # what is beyond the mask: pseudo-Huber
        weights = np.where(rim, border, pulled) / STRAY**2
        # Metres inside grow with pixels along the slope; a pixel is depth / focal metres wide.
        axes, flat = lens.world_to_camera[:3, :3], (pixels - lens.intrinsics[:2, 2]) / focal
        image = axes[:2] - flat[..., None] * axes[2]  # (S, 2, 3) the image's axes in the world
        across = (slope[..., None] * image).sum(1)  # (S, 3)
        numbers = np.flatnonzero(used)
        return across[numbers], -metres[numbers], weights[numbers], numbers

    def beyond(self, body: Body, posed: Posed, frame: int) -> float:
        """Metres by which the surface leaves the masks: 95 % of its points less; NaN without."""
        points, _ = self.skinned(body, posed)
        out = [np.zeros(0)]
        for camera in np.flatnonzero(self._outlines.known[frame]):
            lens = self._outlines.cameras[camera]
            pixels, depths = lens.project(points)
            inside, _ = self._outlines.at(int(camera), frame, pixels)
            out.append(np.maximum(-inside * depths / lens.intrinsics[0, 0], 0))
        every = np.concatenate(out)
        return float(np.nanpercentile(every, 95)) if np.isfinite(every).any() else float("nan")

    def skinned(self, body: Body, posed: Posed) -> tuple[np.ndarray, np.ndarray]:
        """(S, 3) points and normals in the world."""
        rest = mixed(self._points, body.shape)
        rest += (self._nodes @ body.off_skin)[:, None] * self._normals
        moves = posed.places - np.einsum("jab,jb->ja", posed.turns, posed.joints)  # (J, 3)
        turns = self._turns(posed)
        points = (turns @ rest[..., None])[..., 0] + self._weights @ moves
        return points, (turns @ self._normals[..., None])[..., 0]

    def _turns(self, posed: Posed) -> np.ndarray:
        """(S, 3, 3) mixed turns."""
        return (self._weights @ posed.turns.reshape(len(posed.turns), 9)).reshape(-1, 3, 3)

    def reshaped(self, posed: Posed, moved: np.ndarray) -> np.ndarray:
        """As `Term` says."""
        basis = self._turns(posed) @ self._basis  # (S, 3, K)
        back = np.einsum("jab,kjb->jak", posed.turns, self._template.joints[1:])
        moves = moved.transpose(1, 2, 0) - back  # (J, 3, K)
        return basis + (self._weights @ moves.reshape(len(moves), -1)).reshape(basis.shape)

    def own(self, posed: Posed, rows: Rows) -> np.ndarray:
        """By the nodes' stand-off, along the points' normals."""
        normals = (self._turns(posed) @ self._normals[..., None])[..., 0]
        along = (rows.ways * normals[rows.numbers]).sum(1)
        return along[:, None] * self._nodes[rows.numbers]

    def whole(self, off_skin: np.ndarray) -> np.ndarray:
        """(V,) metres that all of the template's vertices stand off, from the nodes'."""
        return self._between(self._template.vertices[0]) @ off_skin


def _outermost(lens: Camera, pixels: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """(N,) whether a camera sees nothing of the body around places (N, 3) ahead of its rim."""
    there, depths = lens.project(ahead)
    away = np.asarray(KDTree(pixels).query(there)[0])
    return away * depths / lens.intrinsics[0, 0] > 0.5 * AHEAD


def _thinned(points: np.ndarray, apart: float) -> np.ndarray:
    """Numbers of points, one in each cell of a grid: the one nearest to its middle."""
    cell = np.floor(points / apart)
    off = np.linalg.norm(points / apart - cell - 0.5, axis=1)
    order = np.argsort(off, kind="stable")
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return np.sort(order[first])


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) outward unit normals, means over the faces around by their areas."""
    corners = vertices[faces]  # (T, 3, 3)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # (T, 3)
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], flat)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
