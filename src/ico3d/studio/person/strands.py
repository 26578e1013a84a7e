"""Strands of hair that grow on the triangles of a mesh and move with them."""

from dataclasses import dataclass

import numpy as np

from ico3d.splat.cpu.compile import kernel, subroutine


@dataclass(frozen=True)
class Strands:
    """N strands with M points in all, each bound to the triangle that it grows on.

    Attributes:
        first: (N + 1,) int32 index of each strand's first point; strand i ends before first[i + 1].
        corners: (N, 3) int32 vertices of the triangle of each root.
        parts: (N, 3) float32 barycentric weights of each root.
        offsets: (M, 3) float32 points relative to the root, along the axes of its triangle (see
            `triangle_axes`), metres.
        open: (M,) float32 share of the light that gets through the hair above, 0 to 1.
        radius: (M,) float32 half of the thickness, metres.
        tone: (N,) float32 factor of the colour.
        material: (N,) uint8 `Material` of each strand.
    """

    first: np.ndarray
    corners: np.ndarray
    parts: np.ndarray
    offsets: np.ndarray
    open: np.ndarray
    radius: np.ndarray
    tone: np.ndarray
    material: np.ndarray

    def on(self, vertices: np.ndarray) -> np.ndarray:
        """(M, 3) float32 points on a mesh with vertices (V, 3) float32, metres."""
        return _posed(vertices, self.corners, self.parts, self.first, self.offsets)


def bound(
    vertices: np.ndarray,
    corners: np.ndarray,
    parts: np.ndarray,
    points: np.ndarray,
    open_: np.ndarray,
    radius: np.ndarray,
    tone: np.ndarray,
    material: int,
) -> Strands:
    """Binds N strands of K points each to triangles of the mesh at rest.

    Args:
        vertices: (V, 3) the mesh at rest, metres.
        corners: (N, 3) vertices of the triangles.
        parts: (N, 3) barycentric weights of the roots.
        points: (N, K, 3) the strands, metres; they need not begin at the root.
        open_: (N, K) see `Strands`.
        radius: (N, K) see `Strands`.
        tone: (N,) see `Strands`.
        material: `Material` of these strands.
    """
    count, length = points.shape[:2]
    at = vertices[corners].astype(float)  # (N, 3, 3)
    roots = np.einsum("nk,nkc->nc", parts, at)
    offsets = np.einsum("nac,nkc->nka", triangle_axes(at), points - roots[:, None])
    return Strands(
        (length * np.arange(count + 1)).astype(np.int32),
        corners.astype(np.int32),
        parts.astype(np.float32),
        offsets.reshape(-1, 3).astype(np.float32),
        np.broadcast_to(open_, (count, length)).ravel().astype(np.float32),
        np.broadcast_to(radius, (count, length)).ravel().astype(np.float32),
        tone.astype(np.float32),
        np.full(count, material, np.uint8),
    )


def joined(groups: list[Strands]) -> Strands:
    """All strands of some groups as one."""
    points = np.cumsum([0, *(len(g.offsets) for g in groups)])
    first = [g.first[:-1] + points[i] for i, g in enumerate(groups)]
    rest = ("corners", "parts", "offsets", "open", "radius", "tone", "material")
    return Strands(
        np.append(np.concatenate(first), points[-1]).astype(np.int32),
        *(np.concatenate([getattr(g, name) for g in groups]) for name in rest),
    )


def triangle_axes(corners: np.ndarray) -> np.ndarray:
    """(N, 3, 3) rows: along the first edge, across it, and normal of triangles (N, 3, 3)."""
    along = corners[:, 1] - corners[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    normal = np.cross(along, corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return np.stack([along, np.cross(normal, along), normal], axis=1)


@kernel(fast=False)
def _posed(vertices, corners, parts, first, offsets):
    out = np.empty(offsets.shape, np.float32)
    axes = np.empty((3, 3))
    root = np.empty(3)
    for n in range(corners.shape[0]):
        a, b, c = corners[n, 0], corners[n, 1], corners[n, 2]
        for k in range(3):
            root[k] = (
                parts[n, 0] * vertices[a, k]
                + parts[n, 1] * vertices[b, k]
                + parts[n, 2] * vertices[c, k]
            )
            axes[0, k] = vertices[b, k] - vertices[a, k]
            axes[1, k] = vertices[c, k] - vertices[a, k]
        _normalise(axes[0])
        _cross(axes[0], axes[1], axes[2])
        _normalise(axes[2])
        _cross(axes[2], axes[0], axes[1])
        for m in range(first[n], first[n + 1]):
            for k in range(3):
                out[m, k] = (
                    root[k]
                    + offsets[m, 0] * axes[0, k]
                    + offsets[m, 1] * axes[1, k]
                    + offsets[m, 2] * axes[2, k]
                )
    return out


@subroutine(fast=False)
def _normalise(v):
    length = max(1e-12, np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2))
    for k in range(3):
        v[k] /= length


@subroutine(fast=False)
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
