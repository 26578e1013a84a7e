"""A z-buffer rasteriser: finds the triangle, and the place on it, that each sample sees."""

import numpy as np
from numba import njit

from ico3d.common.camera import Camera

EMPTY = -1
"""Triangle index of a sample that sees nothing."""


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


@njit(cache=True, nogil=True)
def rasterise(screen, faces, nearest, triangle, barycentric):
    """Draws triangles into buffers; each sample keeps the nearest one.

    Triangles with a vertex of nearness ≤ 0 are skipped. Both sides of a triangle are drawn.

    Args:
        screen: (V, 3) float32 from `to_screen`, or other x, y with a nearness that is linear in
            them.
        faces: (F, 3) int32.
        nearest: (H, W) float32 nearness of what was drawn so far; changed in place.
        triangle: (H, W) int32 triangle indices, `EMPTY` where nothing is seen; changed in place.
        barycentric: (H, W, 2) float32 screen-space weights of the second and third corner; changed
            in place.
    """
    height, width = nearest.shape
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = screen[a, 0], screen[a, 1], screen[a, 2]
        bx, by, bz = screen[b, 0], screen[b, 1], screen[b, 2]
        cx, cy, cz = screen[c, 0], screen[c, 1], screen[c, 2]
        if az <= 0.0 or bz <= 0.0 or cz <= 0.0:
            continue
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        left = max(0, int(np.ceil(min(ax, bx, cx) - 0.5)))
        right = min(width - 1, int(np.floor(max(ax, bx, cx) - 0.5)))
        top = max(0, int(np.ceil(min(ay, by, cy) - 0.5)))
        bottom = min(height - 1, int(np.floor(max(ay, by, cy) - 0.5)))
        inverse = 1.0 / area
        for y in range(top, bottom + 1):
            py = y + 0.5
            for x in range(left, right + 1):
                px = x + 0.5
                v = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) * inverse
                w = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) * inverse
                u = 1.0 - v - w
                # A hair of slack: a sample on a shared edge belongs to at least one neighbour.
                if u < -1e-5 or v < -1e-5 or w < -1e-5:
                    continue
                nearness = u * az + v * bz + w * cz
                if nearness > nearest[y, x]:
                    nearest[y, x] = nearness
                    triangle[y, x] = f
                    barycentric[y, x, 0] = v
                    barycentric[y, x, 1] = w


@njit(cache=True, nogil=True)
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


def empty_buffers(height: int, width: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Empty buffers for `rasterise`.

    Returns:
        Nearness (H, W) float32, triangle (H, W) int32 and barycentric (H, W, 2) float32.
    """
    return (
        np.zeros((height, width), np.float32),
        np.full((height, width), EMPTY, np.int32),
        np.zeros((height, width, 2), np.float32),
    )
