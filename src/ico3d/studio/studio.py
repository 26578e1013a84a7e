"""The studio: draws a person before a backdrop."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from ico3d.common.camera import Camera
from ico3d.studio.person.subject import CARDS, Subject
from ico3d.studio.picture.lighting import BUST, WHOLE, Lamps, Lights, lights_on
from ico3d.studio.picture.materials import Colors
from ico3d.studio.picture.paint import lip_gap, paint
from ico3d.studio.picture.shader import Scene, display, shade, shade_cards
from ico3d.studio.picture.textures import noise
from ico3d.studio.raster import empty_buffers, rasterise, to_screen, vertex_normals

SUPERSAMPLING = 3


def backdrop(camera: Camera, lamps: Lamps) -> np.ndarray:
    """(H, W, 3) float32 picture of a mottled grey cloth far behind the person."""
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1)  # (H, W, 3)
    rays = pixels @ np.linalg.inv(camera.intrinsics).T @ camera.world_to_camera[:3, :3]
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return _cloth_backdrop(rays.astype(np.float32), lamps.cloth)


@njit(cache=True, nogil=True)
def _cloth_backdrop(rays, tint):
    out = np.empty(rays.shape, np.float32)
    for i in range(rays.shape[0]):
        for j in range(rays.shape[1]):
            x, y, z = rays[i, j, 0], rays[i, j, 1], rays[i, j, 2]
            mottle = noise(3 * x, 3 * y, 3 * z) + 0.5 * noise(9 * x + 5, 9 * y, 9 * z)
            value = 0.16 + 0.10 * mottle + 0.22 * (y + 0.1)
            out[i, j, 0] = display(tint[0] * value)
            out[i, j, 1] = display(tint[1] * value)
            out[i, j, 2] = display(tint[2] * value)
    return out


@dataclass(frozen=True)
class Figure:
    """A person in one frame, ready to be drawn by any camera.

    Attributes:
        scene: The posed person in canonical head space.
        lights: The studio's lights in canonical head space.
        world_from_head: (4, 4) pose of the head.
    """

    scene: Scene
    lights: Lights
    world_from_head: np.ndarray


class Studio:
    """Draws pictures of one person."""

    def __init__(self, subject: Subject, lamps: Lamps):
        """Computes the person's painted values, which takes about a second."""
        self.subject = subject
        self._lamps = lamps
        cards = np.isin(subject.materials, CARDS)
        self._solid = np.ascontiguousarray(subject.faces[~cards])
        self._cards = np.ascontiguousarray(subject.faces[cards])
        self._solid_index = np.flatnonzero(~cards).astype(np.int32)
        self._card_index = np.flatnonzero(cards).astype(np.int32)
        self._paint = paint(subject)
        look = subject.look
        self._colors = Colors(
            skin=np.array(look.skin, np.float32),
            lips=np.array(look.lips, np.float32),
            hair=np.array(look.hair, np.float32),
            iris=np.array(look.iris, np.float32),
            cloth=np.array(look.cloth, np.float32),
            stripes=look.stripes,
            freckles=look.freckles,
            stubble=look.stubble,
            accent=np.array(look.accent, np.float32),
            trousers=np.array(look.trousers, np.float32),
            shoe=np.array(look.shoe, np.float32),
            bold=subject.skeleton is not None,
            floor=-float(subject.head_in_world[1]),
            legs=_left_leg(subject),
            skirt=np.array(look.skirt, np.float32),
        )
        self._eyes = np.array(
            [[*eye.centre, *eye.axis, eye.iris_radius] for eye in subject.eyes], np.float32
        )

    def figure(self, vertices: np.ndarray, world_from_head: np.ndarray) -> Figure:
        """Prepares a person for the pictures of one frame.

        Args:
            vertices: (V, 3) float32 posed vertices, canonical head space, metres.
            world_from_head: (4, 4) pose of the head, which moves the whole mesh to the world.
        """
        covered = BUST if self.subject.skeleton is None else WHOLE
        lights = lights_on(vertices, self._solid, world_from_head, self._lamps, covered)
        return Figure(self._scene(vertices), lights, world_from_head)

    def picture(self, camera: Camera, figure: Figure) -> tuple[np.ndarray, np.ndarray]:
        """Draws one picture.

        Returns:
            rgb (H, W, 3) float32, display values premultiplied by alpha, and alpha (H, W) float32,
            the share of each pixel that the person covers.
        """
        scene, lights = figure.scene, figure.lights
        local = camera.moved(figure.world_from_head)
        screen = to_screen(scene.vertices, local, SUPERSAMPLING)
        size = (camera.height * SUPERSAMPLING, camera.width * SUPERSAMPLING)
        centre = local.camera_to_world[:3, 3].astype(np.float32)
        pixel = np.float32(np.linalg.norm(centre) / camera.intrinsics[0, 0])
        nearest, triangle, barycentric = empty_buffers(*size)
        rasterise(screen, self._solid, nearest, triangle, barycentric)
        _renumber(triangle, self._solid_index)
        out = np.zeros((*size, 4), np.float32)
        shade(scene, self._colors, lights, screen, triangle, barycentric, centre, pixel, out)
        front, triangle, barycentric = empty_buffers(*size)
        rasterise(screen, self._cards, front, triangle, barycentric)
        _renumber(triangle, self._card_index)
        shade_cards(
            scene, self._colors, lights, screen, front, triangle, barycentric, nearest, centre,
            pixel, out,
        )  # fmt: skip
        averaged = _averaged(out, SUPERSAMPLING)  # (H, W, 4)
        return averaged[..., :3], averaged[..., 3]

    def _scene(self, vertices: np.ndarray) -> Scene:
        subject = self.subject
        gap = lip_gap(subject.landmarks(vertices))
        return Scene(
            subject.faces,
            subject.materials,
            subject.corner_uv,
            subject.vertices,
            vertices,
            vertex_normals(vertices, subject.faces),
            self._paint.channels,
            self._paint.strands,
            self._paint.occlusion_at(gap),
            self._eyes,
        )


def _left_leg(subject: Subject) -> np.ndarray:
    """(2, 3) float32 hip and ankle at rest; zeros for a bust."""
    bones = subject.skeleton
    if bones is None:
        return np.zeros((2, 3), np.float32)
    return bones.at[[bones.index("upperleg01.L"), bones.index("foot.L")]].astype(np.float32)


@njit(cache=True, nogil=True)
def _renumber(triangle, index):
    """Turns numbers within a subset of faces into numbers within all faces, in place."""
    for y in range(triangle.shape[0]):
        for x in range(triangle.shape[1]):
            if triangle[y, x] >= 0:
                triangle[y, x] = index[triangle[y, x]]


def _averaged(samples: np.ndarray, factor: int) -> np.ndarray:
    """(H, W, C) means of factor × factor blocks of (H·factor, W·factor, C)."""
    height, width, channels = samples.shape
    blocks = samples.reshape(height // factor, factor, width // factor, factor, channels)
    return blocks.mean(axis=(1, 3))
