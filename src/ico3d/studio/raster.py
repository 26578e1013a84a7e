"""A z-buffer rasteriser: finds the triangle, and the place on it, that each sample sees."""

import math

import numpy as np

from ico3d.common.camera import Camera
from ico3d.splat.cpu.compile import kernel, subroutine

EMPTY = -1
"""Number of the face that a sample sees which sees nothing."""
SLACK = 1e-5
NOTHING = np.empty((0, 0), np.int32)
"""Buffer that keeps no faces."""


def to_screen(vertices: np.ndarray, camera: Camera, supersampling: int) -> np.ndarray:
    """Projects vertices onto the sample grid.

    Args:
        vertices: (V, 3) in the camera's world, metres.
        camera: The camera; its image has `supersampling`² samples per pixel.
        supersampling: Samples along each side of a pixel.

    Returns:
        (V, 3) float32: x and y in samples (centres at +0.5) and nearness 1/z, in 1/metres; nearness
        is 0 for vertices behind the camera.
    """
    pixels, depth = camera.project(vertices)
    nearness = np.where(depth > 1e-3, 1.0 / np.maximum(depth, 1e-3), 0.0)
    return np.concatenate([pixels * supersampling, nearness[:, None]], axis=1).astype(np.float32)


@kernel(fast=False)
def rasterise(screen, faces, chosen, nearest, triangle):
    """Draws triangles into buffers; each sample keeps the nearest one.

    Triangles with a vertex of nearness ≤ 0 are skipped. Both sides of a triangle are drawn.

    Args:
        screen: (V, 3) float32 from `to_screen`, or other x, y with a nearness that is linear in
            them.
        faces: (F, 3) int32.
        chosen: (N,) int32 the faces to draw.
        nearest: (H, W) float32 nearness of what was drawn so far; changed in place.
        triangle: (H, W) int32 numbers of faces, `EMPTY` where nothing is seen; changed in place.
            `NOTHING` keeps nearness alone, as for depth maps.
    """
    height, width = nearest.shape
    keeps = triangle.shape[0] == height
    for f in chosen:
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = screen[a, 0], screen[a, 1], screen[a, 2]
        bx, by, bz = screen[b, 0], screen[b, 1], screen[b, 2]
        cx, cy, cz = screen[c, 0], screen[c, 1], screen[c, 2]
        if az <= 0.0 or bz <= 0.0 or cz <= 0.0:
            continue
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        left = max(0, math.ceil(min(ax, bx, cx) - 0.5))
        right = min(width - 1, math.floor(max(ax, bx, cx) - 0.5))
        top = max(0, math.ceil(min(ay, by, cy) - 0.5))
        bottom = min(height - 1, math.floor(max(ay, by, cy) - 0.5))
        if left > right or top > bottom:
            continue
        inverse = 1.0 / area
        v_right, v_down = (cy - ay) * inverse, -(cx - ax) * inverse
        w_right, w_down = -(by - ay) * inverse, (bx - ax) * inverse
        # Screen-space weights of the second and third corner at the first sample of a row.
        v_row = (left + 0.5 - ax) * v_right + (top + 0.5 - ay) * v_down
        w_row = (left + 0.5 - ax) * w_right + (top + 0.5 - ay) * w_down
        for y in range(top, bottom + 1):
            v, w = v_row, w_row
            for x in range(left, right + 1):
                # A hair of slack: a sample on a shared edge belongs to at least one neighbour.
                if v >= -SLACK and w >= -SLACK and v + w <= 1.0 + SLACK:
                    nearness = az + v * (bz - az) + w * (cz - az)
                    if nearness > nearest[y, x]:
                        nearest[y, x] = nearness
                        if keeps:
                            triangle[y, x] = f
                v += v_right
                w += w_right
            v_row += v_down
            w_row += w_down


@subroutine(fast=False)
def weights_at(screen, faces, f, x, y):
    """Perspective-correct weights of a face's corners at a place of the sample grid.

    Args:
        screen: (V, 3) float32 from `to_screen`.
        faces: (F, 3) int32.
        f: Number of the face.
        x: Place in samples.
        y: Place in samples.
    """
    i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
    ax, ay = screen[i, 0], screen[i, 1]
    bx, by, cx, cy = screen[j, 0] - ax, screen[j, 1] - ay, screen[k, 0] - ax, screen[k, 1] - ay
    inverse = 1.0 / (bx * cy - by * cx)
    v = ((x - ax) * cy - (y - ay) * cx) * inverse
    w = (bx * (y - ay) - by * (x - ax)) * inverse
    a, b, c = (1.0 - v - w) * screen[i, 2], v * screen[j, 2], w * screen[k, 2]
    total = 1.0 / (a + b + c)
    return a * total, b * total, c * total


@kernel(fast=False)
def vertex_normals(vertices, faces):
    """(V, 3) float32 unit normals: area-weighted means of the faces around each vertex."""
    normals = np.zeros_like(vertices)
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = (
            vertices[b, 0] - vertices[a, 0],
            vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2],
        )
        wx, wy, wz = (
            vertices[c, 0] - vertices[a, 0],
            vertices[c, 1] - vertices[a, 1],
            vertices[c, 2] - vertices[a, 2],
        )
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        for corner in range(3):
            i = faces[f, corner]
            normals[i, 0] += nx
            normals[i, 1] += ny
            normals[i, 2] += nz
    for i in range(normals.shape[0]):
        length = np.sqrt(normals[i, 0] ** 2 + normals[i, 1] ** 2 + normals[i, 2] ** 2)
        if length > 0.0:
            for axis in range(3):  # a row as a whole takes seconds to compile
                normals[i, axis] /= length
    return normals


def empty_buffers(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Empty buffers for `rasterise`: nearness (H, W) float32 and faces (H, W) int32."""
    return np.zeros((height, width), np.float32), np.full((height, width), EMPTY, np.int32)


def light_basis(direction: np.ndarray) -> np.ndarray:
    """(3, 3) rows right, down and towards the light, for parallel light from `direction`."""
    towards = direction / np.linalg.norm(direction)
    up = np.array([0.0, 1.0, 0.0]) if abs(towards[1]) < 0.99 else np.array([0.0, 0.0, 1.0])
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, -np.cross(towards, right), towards])


def depth_map(
    vertices: np.ndarray,
    faces: np.ndarray,
    chosen: np.ndarray,
    direction: np.ndarray,
    size: int,
    reach: float,
) -> tuple[np.ndarray, np.ndarray]:
    """What parallel light meets first.

    Args:
        vertices: (V, 3) float32 metres from the middle of the map.
        faces: (F, 3) int32.
        chosen: (N,) int32 the faces that light does not pass.
        direction: (3,) unit vector towards the light.
        size: Side of the map in texels.
        reach: Half the side of the map in metres.

    Returns:
        The map (S, S) float32, metres towards the light plus 2, or 0 where nothing is met; and
        (V, 3) float32 places of the vertices in it: texels, and metres towards the light plus 2.
    """
    screen = vertices @ light_basis(direction).T.astype(np.float32)  # (V, 3)
    screen[:, :2] = screen[:, :2] * (size / (2 * reach)) + size / 2
    screen[:, 2] += 2.0
    nearest = np.zeros((size, size), np.float32)
    rasterise(screen, faces, chosen, nearest, NOTHING)
    return nearest, screen
