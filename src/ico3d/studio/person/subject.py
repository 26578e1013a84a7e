"""A synthetic person: a deformable mesh with everything needed to record it."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ico3d.studio.person.skeleton import Skeleton
from ico3d.studio.person.strands import Strands


class Material(IntEnum):
    """Material of a face of the mesh; the shader selects by these numbers."""

    SKIN = 0
    MOUTH = 1
    EYE = 2
    TEETH = 3
    GUMS = 4
    TONGUE = 5
    HAIR = 6
    CLOTH = 7
    BROW = 8
    LASH = 9
    TROUSERS = 10
    SHOE = 11
    SOCK = 12
    SKIRT = 13
    FRAME = 14
    LENS = 15


CARDS = (Material.BROW, Material.LASH, Material.LENS)
"""Materials of flat cards, and of lenses, through which what lies behind them is seen."""
GARMENTS = (Material.CLOTH, Material.TROUSERS, Material.SHOE, Material.SOCK)


@dataclass(frozen=True)
class Eye:
    """An eyeball at rest.

    Attributes:
        centre: (3,) centre in canonical head space, metres.
        axis: (3,) unit vector from the centre through the pupil.
        iris_radius: Radius of the iris, perpendicular to the axis, metres.
    """

    centre: np.ndarray
    axis: np.ndarray
    iris_radius: float


@dataclass(frozen=True)
class Look:
    """Colours of a person in linear RGB.

    Attributes:
        skin: (3,) albedo of the cheek.
        lips: (3,) albedo of the lips.
        hair: (3,) albedo of a strand.
        iris: (3,) albedo of the iris.
        cloth: (2, 3) albedo of the cloth and of its pattern.
        stripes: Whether the pattern of the cloth is stripes; otherwise flowers.
        freckles: Amount of freckles, 0 to 1.
        stubble: Visibility of a shaved beard, 0 to 1.
        accent: (3,) albedo of the third colour of a whole person's shirt.
        trousers: (2, 3) albedo of the trousers and of their checks.
        shoe: (3,) albedo of the leather.
        skirt: (2, 3) albedo of a skirt and of its pattern.
        jumper: (3,) albedo of the wool of a plain jumper.
        jeans: (2, 3) albedo of jeans, dark and worn pale.
        leather: (3,) albedo of plain shoes.
    """

    skin: tuple[float, float, float]
    lips: tuple[float, float, float]
    hair: tuple[float, float, float]
    iris: tuple[float, float, float]
    cloth: tuple[tuple[float, float, float], tuple[float, float, float]]
    stripes: bool
    freckles: float
    stubble: float
    accent: tuple[float, float, float] = (0.45, 0.09, 0.04)
    trousers: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (0.10, 0.12, 0.17),
        (0.30, 0.29, 0.27),
    )
    shoe: tuple[float, float, float] = (0.13, 0.06, 0.03)
    skirt: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (0.045, 0.17, 0.13),
        (0.62, 0.46, 0.17),
    )
    jumper: tuple[float, float, float] = (0.46, 0.40, 0.31)
    jeans: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (0.022, 0.035, 0.075),
        (0.20, 0.27, 0.38),
    )
    leather: tuple[float, float, float] = (0.115, 0.047, 0.020)


@dataclass(frozen=True)
class Subject:
    """A person in canonical head space: metres, +Y up, +Z as the face looks, +X their left.

    Attributes:
        name: Name used in reports.
        vertices: (V, 3) float32 vertices of the neutral face, metres.
        faces: (F, 3) int32, counter-clockwise seen from outside.
        materials: (F,) uint8, the `Material` of each face.
        corner_uv: (F, 3, 2) float32 texture coordinates. Hair: strands run along v. Cloth: metres.
            Brows: u from the nose outwards, v upwards. Lashes: u along the lid (plus 2 on the lower
            lid), v from root to tip.
        lip_mask: (V,) float32, 1 on the red of the lips.
        blendshape_names: ARKit names of the K blendshapes.
        delta_vertices: (M,) int32 indices of the vertices that blendshapes move.
        deltas: (K, M, 3) float32 displacements at weight 1, metres.
        visemes: (K,) blendshape weights by Oculus viseme name.
        landmark_vertices: (68,) int32 indices of vertices in Multi-PIE order.
        eyes: The person's left and right eye.
        neck_base: (3,) point about which the head sways, metres.
        head_in_world: (3,) position of the canonical origin in the world at rest, metres; the floor
            is y = 0.
        male: Whether the voice should be a man's.
        look: Colours of the person.
        sources: Names and licences of what the geometry was made from.
        licence: Licence of pictures that show this person.
        skeleton: Skeleton of a whole person, whose vertices are given in the skeleton's rest pose;
            None for a bust.
        strands: Hair that is drawn strand by strand; None if only meshes stand for hair.
        draped: Whether the mesh of the jumper hangs in folds, so that no relief need paint them.
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    materials: np.ndarray
    corner_uv: np.ndarray
    lip_mask: np.ndarray
    blendshape_names: tuple[str, ...]
    delta_vertices: np.ndarray
    deltas: np.ndarray
    visemes: dict[str, np.ndarray]
    landmark_vertices: np.ndarray
    eyes: tuple[Eye, Eye]
    neck_base: np.ndarray
    head_in_world: np.ndarray
    male: bool
    look: Look
    sources: tuple[str, ...]
    licence: str
    skeleton: Skeleton | None = None
    strands: Strands | None = None
    draped: bool = False

    def posed(self, weights: np.ndarray) -> np.ndarray:
        """Vertices (V, 3) float32 for blendshape weights (K,), metres."""
        vertices = self.vertices.copy()
        moved = np.einsum("k,kmc->mc", weights.astype(np.float32), self.deltas)  # (M, 3)
        vertices[self.delta_vertices] += moved
        return vertices

    def landmarks(self, vertices: np.ndarray) -> np.ndarray:
        """(68, 3) float32 landmarks of posed vertices (V, 3)."""
        return vertices[self.landmark_vertices]

    def weights(self, values: dict[str, float]) -> np.ndarray:
        """(K,) float32 weights from values by name; names this person lacks are ignored."""
        return np.array([values.get(name, 0.0) for name in self.blendshape_names], np.float32)
