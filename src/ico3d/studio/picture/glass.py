"""Lenses of glasses: what lies behind shows through, and the room is mirrored in them."""

import math

import numpy as np

from ico3d.splat.cpu.compile import kernel
from ico3d.studio.picture.lighting import Lights, mirrored
from ico3d.studio.picture.shader import BRIGHTEST, Scene
from ico3d.studio.raster import empty_buffers, rasterise, weights_at

ABSORBED = 0.03
"""Share of the light that stays in a lens."""
FRONTAL = 0.02
"""Reflectance of a coated surface of a lens at frontal view."""
BLUR = 0.05
"""Tangent by which mirrored lamps are blurred."""


def glaze(
    picture: np.ndarray,
    nearest: np.ndarray,
    factor: int,
    scene: Scene,
    lenses: np.ndarray,
    screen: np.ndarray,
    camera: np.ndarray,
    lights: Lights,
) -> None:
    """Puts lenses over a picture of what lies behind them.

    Args:
        picture: (H, W, 4) float32 linear light and alpha, premultiplied; changed in place.
        nearest: (H·factor, W·factor) float32 nearness of the solid surfaces.
        factor: Samples along the side of a pixel.
        scene: The posed person.
        lenses: (N,) int32 the faces that are lenses.
        screen: (V, 3) float32 from `to_screen`.
        camera: (3,) the camera's centre in canonical head space.
        lights: Lights of the frame.
    """
    glass, triangle = empty_buffers(*nearest.shape)
    rasterise(screen, scene.faces, lenses, glass, triangle)
    triangle[glass <= nearest] = -1
    _mirror(
        picture,
        triangle,
        factor,
        screen,
        (scene.faces, scene.vertices, scene.normals),
        camera,
        lights,
    )


@kernel(fast=False)
def _mirror(picture, triangle, factor, screen, mesh, camera, lights):
    faces, vertices, normals = mesh
    share_of_one = 1.0 / (factor * factor)
    for y in range(picture.shape[0]):
        for x in range(picture.shape[1]):
            share, column, row = 0.0, 0, 0
            for sy in range(y * factor, (y + 1) * factor):
                for sx in range(x * factor, (x + 1) * factor):
                    if triangle[sy, sx] >= 0:
                        share += share_of_one
                        column, row = sx, sy
            if share == 0.0:
                continue
            f = triangle[row, column]
            weights = weights_at(screen, faces, f, column + 0.5, row + 0.5)
            n, v = np.zeros(3), camera.astype(np.float64)
            for k in range(3):
                for c in range(3):
                    n[c] += weights[k] * normals[faces[f, k], c]
                    v[c] -= weights[k] * vertices[faces[f, k], c]
            n /= math.sqrt((n * n).sum())
            v /= math.sqrt((v * v).sum())
            facing = (n * v).sum()
            if facing < 0.0:
                n, facing = -n, -facing
            surface = FRONTAL + (1.0 - FRONTAL) * (1.0 - facing) ** 5
            mirror = 2.0 * surface / (1.0 + surface)  # of both surfaces of a thin pane
            to = 2.0 * facing * n - v
            light = mirrored(lights, (to[0], to[1], to[2]), BLUR)
            through = 1.0 - share * (mirror + ABSORBED)
            for c in range(3):
                shown = min(light[c], BRIGHTEST / mirror)
                picture[y, x, c] = picture[y, x, c] * through + share * mirror * shown
            picture[y, x, 3] = 1.0 - (1.0 - picture[y, x, 3]) * (1.0 - share * mirror)
