"""Numba kernels of linear blend skinning, forward and backward.

A joint's row of the table holds its rotation matrix (9), its translation (3) and its quaternion
(4), see `kinematics.transforms`.
"""

import numpy as np

from ico3d.common.native.jit import numba
from ico3d.splat.cpu.compile import PARTS, kernel, subroutine

ROW = 16
"""Numbers in the row of a joint."""
INFLUENCES = 4
"""Joints that carry a Gaussian."""


@subroutine(inline=True)
def _blend(table, joints, logits, weights, mixed):
    """Writes the softmax of four logits as weights, and the joints' rows mixed by these weights."""
    most = max(max(logits[0], logits[1]), max(logits[2], logits[3]))
    total = np.float32(0)
    for k in range(INFLUENCES):
        weights[k] = np.exp(logits[k] - most)
        total += weights[k]
    for c in range(ROW):
        mixed[c] = 0
    for k in range(INFLUENCES):
        weights[k] /= total
        row = table[joints[k]]
        for c in range(ROW):
            mixed[c] += weights[k] * row[c]


@kernel(parallel=True)
def forward(table, joints, logits, means, quats, normals, out_means, out_quats, out_normals):
    """Writes means, rotations and normals of the posed Gaussians.

    Args:
        table: (J, 16) rows of the joints.
        joints: (N, 4) joints that carry each Gaussian.
        logits: (N, 4), whose softmax gives the weights of these joints.
        means: (N, 3) at rest.
        quats: (N, 4) wxyz at rest.
        normals: (N, 3) at rest.
        out_means: (N, 3), written.
        out_quats: (N, 4), written.
        out_normals: (N, 3), written.
    """
    count = len(means)
    size = (count + PARTS - 1) // PARTS
    for part in numba.prange(PARTS):
        weights, m = np.empty(INFLUENCES, np.float32), np.empty(ROW, np.float32)
        for i in range(part * size, min((part + 1) * size, count)):
            _blend(table, joints[i], logits[i], weights, m)
            x, n, a = means[i], normals[i], quats[i]
            for r in range(3):
                p, q, s = m[3 * r], m[3 * r + 1], m[3 * r + 2]
                out_means[i, r] = p * x[0] + q * x[1] + s * x[2] + m[9 + r]
                out_normals[i, r] = p * n[0] + q * n[1] + s * n[2]
            w, u, v, t = m[12], m[13], m[14], m[15]
            out_quats[i, 0] = w * a[0] - u * a[1] - v * a[2] - t * a[3]
            out_quats[i, 1] = w * a[1] + u * a[0] + v * a[3] - t * a[2]
            out_quats[i, 2] = w * a[2] - u * a[3] + v * a[0] + t * a[1]
            out_quats[i, 3] = w * a[3] + u * a[2] - v * a[1] + t * a[0]


@subroutine(inline=True)
def _blend_backward(m, x, n, a, g, gn, h, row):
    """Writes the gradient of the mixed row (16,) of one Gaussian.

    It follows from the Gaussian at rest (mean x, normal n, quaternion a) and from the gradients of
    its posed mean g, normal gn and quaternion h.
    """
    for r in range(3):
        for c in range(3):
            row[3 * r + c] = g[r] * x[c] + gn[r] * n[c]
        row[9 + r] = g[r]
    row[12] = h[0] * a[0] + h[1] * a[1] + h[2] * a[2] + h[3] * a[3]
    row[13] = -h[0] * a[1] + h[1] * a[0] - h[2] * a[3] + h[3] * a[2]
    row[14] = -h[0] * a[2] + h[1] * a[3] + h[2] * a[0] - h[3] * a[1]
    row[15] = -h[0] * a[3] - h[1] * a[2] + h[2] * a[1] + h[3] * a[0]


@kernel(parallel=True)
def backward(
    table, joints, logits, means, quats, normals, g_places, g_turns, g_facing,
    g_table, g_logits, g_means, g_quats,
):  # fmt: skip
    """Gradients of `forward`; those before `g_places` are as given to `forward`.

    Args:
        table: (J, 16).
        joints: (N, 4).
        logits: (N, 4).
        means: (N, 3).
        quats: (N, 4).
        normals: (N, 3).
        g_places: (N, 3) gradient of the posed means.
        g_turns: (N, 4) gradient of the posed quaternions.
        g_facing: (N, 3) gradient of the posed normals.
        g_table: (PARTS, J, 16), added to; its sum over PARTS is the gradient of the table.
        g_logits: (N, 4), written.
        g_means: (N, 3), written.
        g_quats: (N, 4), written.
    """
    count = len(means)
    size = (count + PARTS - 1) // PARTS
    for part in numba.prange(PARTS):
        weights, m = np.empty(INFLUENCES, np.float32), np.empty(ROW, np.float32)
        row, slope = np.empty(ROW, np.float32), np.empty(INFLUENCES, np.float32)
        for i in range(part * size, min((part + 1) * size, count)):
            _blend(table, joints[i], logits[i], weights, m)
            g, h = g_places[i], g_turns[i]
            _blend_backward(m, means[i], normals[i], quats[i], g, g_facing[i], h, row)
            for c in range(3):
                g_means[i, c] = m[c] * g[0] + m[3 + c] * g[1] + m[6 + c] * g[2]
            w, u, v, t = m[12], m[13], m[14], m[15]
            g_quats[i, 0] = w * h[0] + u * h[1] + v * h[2] + t * h[3]
            g_quats[i, 1] = -u * h[0] + w * h[1] + t * h[2] - v * h[3]
            g_quats[i, 2] = -v * h[0] - t * h[1] + w * h[2] + u * h[3]
            g_quats[i, 3] = -t * h[0] + v * h[1] - u * h[2] + w * h[3]
            mean = np.float32(0)
            for k in range(INFLUENCES):
                joint = joints[i, k]
                slope[k] = 0
                for c in range(ROW):
                    slope[k] += table[joint, c] * row[c]
                    g_table[part, joint, c] += weights[k] * row[c]
                mean += weights[k] * slope[k]
            for k in range(INFLUENCES):
                g_logits[i, k] = weights[k] * (slope[k] - mean)
