"""Fits the template's surface to masks, with clothes and hair at fixed distances off the skin."""

import numpy as np
from scipy.spatial import KDTree

from ico3d.capture.posing.fitting.body import Body, Kinematics, Posed, mixed
from ico3d.capture.posing.fitting.rows import Rows
from ico3d.capture.posing.model.template import Template
from ico3d.capture.posing.seeing.outlines import Outlines
from ico3d.common.camera import Camera

COARSE, FINE = 0.03, 0.012
"""Distance in metres between the points of the surface that are compared: in general, on hands."""
CAMERAS_AT_ONCE = 6
"""Number of cameras whose outlines a step uses."""
AHEAD = 0.03
"""Distance in metres outside of a rim at which no other part of the body may be seen.

Where one is seen, the rim is no part of the outline.
"""
RIM = 0.3
"""Cosine between normal and line of sight below which a point may lie on the outline."""
STRAY, CUT_OFF = 0.010, 0.04
"""Standard deviation of outlines in metres, and distance from which they hardly count any more."""
CLOTHES, HAIR, SKIN = (0.012, 0.015), (0.0, 0.015), (0.0, 0.0015)
"""Mean and standard deviation in metres of the distance off the template.

They are those of clothes, of hair (neck and head), and of the skin of hands.
"""
SMOOTH = 0.012
"""Standard deviation in metres between the distances of neighbouring nodes."""
APART, NEIGHBOURS = 0.08, 6
"""Distance in metres between nodes, at which distances off the template are fitted; neighbours of
a node."""
MIXED = 4
"""Number of nodes between which the distance of a point is interpolated."""
SAY = 0.06
"""Factor of the weights of points, as neighbouring points are not independent."""
HAND, HEAD = ("wrist", "metacarpal", "finger"), ("neck", "head")
"""Beginnings of the names of joints of hands and of the head."""


class Surface:
    """A `Term` of S points of the template's surface, which are compared with outlines.

    Attributes:
        carried: (S, J) share of each point that is carried by each joint or a joint below it.
        usual: (M,) mean distance off the template at each node, metres.
        information: (M, M) inverse covariance of the distances at the nodes.
    """

    def __init__(self, kinematics: Kinematics, outlines: Outlines, frames: np.ndarray, seed: int):
        """Chooses points and nodes, spread about evenly over the surface.

        Args:
            kinematics: Forward kinematics of the template.
            outlines: Outlines of the person in the recording.
            frames: (F,) indices in the recording of the frames of the fit.
            seed: Seed of the choice of cameras in each step.
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
        """(N, M) weights with which nodes are interpolated at points (N, 3) of the mean shape."""
        away, near = self._tree.query(points, MIXED)
        parts = 1 / np.maximum(away, 0.01) ** 2  # (N, 4)
        weights = np.zeros((len(points), self._tree.n))
        np.put_along_axis(weights, np.asarray(near), parts / parts.sum(1, keepdims=True), 1)
        return weights

    @staticmethod
    def _clothed(carriers: list[str]) -> np.ndarray:
        """(2, M) mean and standard deviation in metres of nodes, by names of their joints."""
        kinds = [
            SKIN if name.startswith(HAND) else HAIR if name.startswith(HEAD) else CLOTHES
            for name in carriers
        ]
        return np.array(kinds).T

    def _smoothness(self, nodes: np.ndarray, spread: np.ndarray) -> np.ndarray:
        """(M, M) inverse covariance of distances at nodes (M, 3): near their means, and smooth."""
        near = np.asarray(self._tree.query(nodes, NEIGHBOURS + 1)[1])[:, 1:]  # (M, 6)
        rows, edges = np.repeat(np.arange(len(nodes)), NEIGHBOURS), np.arange(near.size)
        differ = np.zeros((len(edges), len(nodes)))
        differ[edges, rows], differ[edges, near.ravel()] = 1, -1
        return differ.T @ differ / SMOOTH**2 / 2 + np.diag(1 / spread**2)

    def rows(self, body: Body, posed: Posed, frame: int) -> Rows:
        """Equations of all points that are outside of a mask, or on the outline in a camera."""
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
        """Equations of one camera.

        Args:
            camera: Index of the camera among those of the outlines.
            number: Index of the frame in the recording.
            points: (S, 3) points in the world, metres.
            normals: (S, 3) normals of the points.

        Returns:
            `ways`, `missing`, `weights` and `numbers` of `Rows`.
        """
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
        pulled = 1 / np.sqrt(1 + off**2)  # of points outside of the mask: pseudo-Huber
        weights = np.where(rim, border, pulled) / STRAY**2
        # Distances inside grow with pixels along the slope; a pixel is depth / focal metres wide.
        axes, flat = lens.world_to_camera[:3, :3], (pixels - lens.intrinsics[:2, 2]) / focal
        image = axes[:2] - flat[..., None] * axes[2]  # (S, 2, 3) axes of the picture in the world
        across = (slope[..., None] * image).sum(1)  # (S, 3)
        numbers = np.flatnonzero(used)
        return across[numbers], -metres[numbers], weights[numbers], numbers

    def beyond(self, body: Body, posed: Posed, frame: int) -> float:
        """95 % quantile of the distance by which points are outside of a frame's masks, metres.

        NaN without masks; `frame` is the index in the recording.
        """
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
        """(S, 3) points and (S, 3) normals in the world."""
        rest = mixed(self._points, body.shape)
        rest += (self._nodes @ body.off_skin)[:, None] * self._normals
        moves = posed.places - np.einsum("jab,jb->ja", posed.turns, posed.joints)  # (J, 3)
        turns = self._turns(posed)
        points = (turns @ rest[..., None])[..., 0] + self._weights @ moves
        return points, (turns @ self._normals[..., None])[..., 0]

    def _turns(self, posed: Posed) -> np.ndarray:
        """(S, 3, 3) blended rotation matrices of the points."""
        return (self._weights @ posed.turns.reshape(len(posed.turns), 9)).reshape(-1, 3, 3)

    def reshaped(self, posed: Posed, moved: np.ndarray) -> np.ndarray:
        """(S, 3, K) derivatives of the points by shape coefficients, see `Term.reshaped`."""
        basis = self._turns(posed) @ self._basis  # (S, 3, K)
        back = np.einsum("jab,kjb->jak", posed.turns, self._template.joints[1:])
        moves = moved.transpose(1, 2, 0) - back  # (J, 3, K)
        return basis + (self._weights @ moves.reshape(len(moves), -1)).reshape(basis.shape)

    def own(self, posed: Posed, rows: Rows) -> np.ndarray:
        """(N, M) derivatives by the nodes' distances off the template, see `Term.own`."""
        normals = (self._turns(posed) @ self._normals[..., None])[..., 0]
        along = (rows.ways * normals[rows.numbers]).sum(1)
        return along[:, None] * self._nodes[rows.numbers]

    def whole(self, off_skin: np.ndarray) -> np.ndarray:
        """(V,) distances off the template of all vertices, from those of nodes (M,), metres."""
        return self._between(self._template.vertices[0]) @ off_skin


def _outermost(lens: Camera, pixels: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """(N,) bool: whether a camera sees no point of the body near positions outside of a rim.

    Args:
        lens: The camera.
        pixels: (S, 2) all points of the body in the picture.
        ahead: (N, 3) positions `AHEAD` metres outside of points on a rim.
    """
    there, depths = lens.project(ahead)
    away = np.asarray(KDTree(pixels).query(there)[0])
    return away * depths / lens.intrinsics[0, 0] > 0.5 * AHEAD


def _thinned(points: np.ndarray, apart: float) -> np.ndarray:
    """Indices of a subset of points (N, 3): of each cell of a grid the one nearest to its middle.

    `apart` is the edge of a cell, metres.
    """
    cell = np.floor(points / apart)
    off = np.linalg.norm(points / apart - cell - 0.5, axis=1)
    order = np.argsort(off, kind="stable")
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return np.sort(order[first])


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) outward unit normals of vertices: means over adjacent faces, weighted by area.

    Args:
        vertices: (V, 3) positions.
        faces: (T, 3) corners of triangles, counter-clockwise seen from outside.
    """
    corners = vertices[faces]  # (T, 3, 3)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])  # (T, 3)
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], flat)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
