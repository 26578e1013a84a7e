"""The studio: draws a person before a backdrop."""

from dataclasses import dataclass

import numpy as np

from ico3d.common.camera import Camera
from ico3d.splat.cpu.compile import kernel
from ico3d.studio.dress.tailoring import tailored
from ico3d.studio.person.subject import CARDS, Material, Subject
from ico3d.studio.picture.eyeball import eye_rows
from ico3d.studio.picture.fibres import overlay, strand_colors
from ico3d.studio.picture.glass import glaze
from ico3d.studio.picture.lamps import Lamps
from ico3d.studio.picture.lighting import KEY, LOOKED_UP, RIM, Lights, lights_on
from ico3d.studio.picture.materials import Colors
from ico3d.studio.picture.occlusion import Sky
from ico3d.studio.picture.paint import lip_gap, paint
from ico3d.studio.picture.shader import Scene, shade
from ico3d.studio.picture.shadows import BUST, WHOLE
from ico3d.studio.picture.textures import noise
from ico3d.studio.picture.tones import developed, display
from ico3d.studio.raster import empty_buffers, rasterise, to_screen, vertex_normals

CLOTHES = ("plain", "patterned")
"""A knitted jumper, jeans and leather shoes; or prints that show from metres away."""
SUPERSAMPLING = 3
GLOW = (0.62, 0.62, 0.5)
"""Light on the cloth behind the person: at the edges, what the middle has more, and how wide that
is as a share of the picture."""
BODY_MAP = (320, 1.1)
"""Depth maps of a whole person for occlusion: texels along the side, and half of it in metres."""
BODY_DIRECTIONS = 40
THROUGH = np.float32(0.12)
"""Share of the sky's light that wool scatters on to places of a body that see nothing of it."""
NECK, NECK_BLEND = -0.2, 0.06
"""Height in metres below which occlusion of a whole person is that of the pose, and the height
above it within which that of the head takes over."""


def backdrop(camera: Camera, lamps: Lamps) -> np.ndarray:
    """(H, W, 3) float32 picture of a mottled grey cloth behind the person, lit in the middle."""
    columns, rows = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1)  # (H, W, 3)
    rays = pixels @ np.linalg.inv(camera.intrinsics).T @ camera.world_to_camera[:3, :3]
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    middle = pixels[..., :2] / (camera.width, camera.height) - (0.5, 0.45)
    glow = GLOW[0] + GLOW[1] * np.exp(-((middle / GLOW[2]) ** 2).sum(axis=-1))  # (H, W)
    return _cloth_backdrop(rays.astype(np.float32), glow.astype(np.float32), lamps.cloth)


@kernel(fast=False)
def _cloth_backdrop(rays, glow, tint):
    out = np.empty(rays.shape, np.float32)
    for i in range(rays.shape[0]):
        for j in range(rays.shape[1]):
            x, y, z = rays[i, j, 0], rays[i, j, 1], rays[i, j, 2]
            mottle = noise(3 * x, 3 * y, 3 * z) + 0.5 * noise(9 * x + 5, 9 * y, 9 * z)
            value = glow[i, j] * (0.16 + 0.10 * mottle + 0.22 * (y + 0.1))
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
        strands: (M, 3) float32 points of the hair's strands in canonical head space, metres; None
            for a person without strands.
    """

    scene: Scene
    lights: Lights
    world_from_head: np.ndarray
    strands: np.ndarray | None


class Studio:
    """Draws pictures of one person."""

    def __init__(self, subject: Subject, lamps: Lamps, clothes: str = "plain"):
        """Computes the person's painted values, which takes about a second.

        Args:
            subject: The person.
            lamps: How the studio is lit.
            clothes: One of `CLOTHES`.
        """
        self.subject = subject
        self._lamps = lamps
        cards = np.isin(subject.materials, CARDS)
        self._solid = np.flatnonzero(~cards).astype(np.int32)
        lenses = subject.materials == Material.LENS
        self._lenses = np.flatnonzero(lenses).astype(np.int32)
        self._paint = paint(subject)
        self._tailored = tailored(subject)
        self._sky = None if subject.skeleton is None else Sky(subject, *BODY_MAP, BODY_DIRECTIONS)
        # From the neck up, occlusion comes from the finer maps of the head.
        self._above = np.clip((subject.vertices[:, 1] - NECK) / NECK_BLEND, 0, 1)
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
            plain=clothes == "plain",
            jumper=np.array(look.jumper, np.float32),
            jeans=np.array(look.jeans, np.float32),
            leather=np.array(look.leather, np.float32),
        )
        if subject.strands is not None:
            self._strand_colors = strand_colors(subject.strands, self._colors.hair)

    def figure(self, vertices: np.ndarray, world_from_head: np.ndarray) -> Figure:
        """Prepares a person for the pictures of one frame.

        Args:
            vertices: (V, 3) float32 posed vertices, canonical head space, metres.
            world_from_head: (4, 4) pose of the head, which moves the whole mesh to the world.
        """
        covered = BUST if self.subject.skeleton is None else WHOLE
        lights = lights_on(
            vertices, self.subject.faces, self._solid, world_from_head, self._lamps, covered
        )
        hair = self.subject.strands
        strands = None if hair is None else hair.on(vertices)
        return Figure(self._scene(vertices, lights), lights, world_from_head, strands)

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
        nearest, triangle = empty_buffers(*size)
        rasterise(screen, scene.faces, self._solid, nearest, triangle)
        out = np.zeros((camera.height, camera.width, 4), np.float32)
        shade(scene, self._colors, lights, screen, nearest, triangle, centre, pixel, out)
        hair = self.subject.strands
        if hair is not None and figure.strands is not None:
            overlay(
                out,
                nearest,
                SUPERSAMPLING,
                hair,
                figure.strands,
                self._strand_colors,
                local,
                lights,
            )
        if len(self._lenses):
            factor = SUPERSAMPLING
            glaze(out, nearest, factor, scene, self._lenses, screen, centre, lights)
        finished = developed(out)  # (H, W, 4)
        return finished[..., :3], finished[..., 3]

    def _scene(self, vertices: np.ndarray, lights: Lights) -> Scene:
        subject = self.subject
        gap = lip_gap(subject.landmarks(vertices))
        return Scene(
            subject.faces,
            subject.materials,
            self._tailored.corner_uv if self._colors.plain else subject.corner_uv,
            subject.vertices,
            vertices,
            vertex_normals(vertices, subject.faces),
            self._paint.channels,
            self._paint.strands,
            self._occlusion(vertices, gap),
            self._lamps_on_clothes(vertices, lights),
            self._tailored.fields,
            self._tailored.folds(vertices),
            eye_rows(subject, vertices),
            self._paint.hands.lines,
            self._paint.hands.nails,
        )

    def _occlusion(self, vertices: np.ndarray, gap: float) -> np.ndarray:
        """(V,) float32 visible share of the sky: of a head by its lips, of a body by its pose."""
        head = self._paint.occlusion_at(gap)
        if self._sky is None:
            return head
        middle = 0.5 * (vertices.max(axis=0) + vertices.min(axis=0))
        body = THROUGH + (1 - THROUGH) * self._sky.visible(vertices - middle)
        return body + self._above * (np.minimum(head, 1.3 * body + 0.2) - body)

    def _lamps_on_clothes(self, vertices: np.ndarray, lights: Lights) -> np.ndarray:
        """(V, 2) float32 shares of key and rim light that clothes see, by all of a lamp's face.

        A lamp's nearest shade alone, as depth maps are looked up, leaves blots on a broad chest.
        """
        if self._sky is None:
            return np.full((len(vertices), 2), LOOKED_UP, np.float32)
        middle = 0.5 * (vertices.max(axis=0) + vertices.min(axis=0))
        shares = [
            self._sky.lamp(vertices - middle, lights.directions[i], float(lights.sizes[i]))
            for i in (KEY, RIM)
        ]
        return np.stack(shares, 1)


def _left_leg(subject: Subject) -> np.ndarray:
    """(2, 3) float32 hip and ankle at rest; zeros for a bust."""
    bones = subject.skeleton
    if bones is None:
        return np.zeros((2, 3), np.float32)
    return bones.at[[bones.index("upperleg01.L"), bones.index("foot.L")]].astype(np.float32)
