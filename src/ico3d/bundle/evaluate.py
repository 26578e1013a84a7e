"""The reference evaluator of the baked head, against which shaders are tested."""

import numpy as np

from ico3d.bundle.head import BakedHead
from ico3d.common.expression import EYE_UNIT, LEAKY_SLOPE


def coefficients(head: BakedHead, expression: np.ndarray) -> np.ndarray:
    """Factors of the basis: c(e) = LeakyReLU(e·w1 + b1)·w2 + b2.

    Args:
        head: The baked head.
        expression: (B,) or (T, B) expressions e.

    Returns:
        (K,) or (T, K) float32.
    """
    return _network(expression, head.w1, head.b1, head.w2, head.b2)


def steps(head: BakedHead, expression: np.ndarray) -> np.ndarray:
    """Metres per unit of each displacement: d(e), by a network as that of `coefficients`.

    Args:
        head: The baked head.
        expression: (B,) or (T, B) expressions e.

    Returns:
        (M,) or (T, M) float32.
    """
    parts = (head.displacement_w1, head.displacement_b1, head.displacement_w2, head.displacement_b2)
    return _network(expression, *parts)


def _network(
    expression: np.ndarray, w1: np.ndarray, b1: np.ndarray, w2: np.ndarray, b2: np.ndarray
) -> np.ndarray:
    hidden = np.asarray(expression, np.float32) @ w1 + b1  # (..., H)
    hidden = np.where(hidden > 0, hidden, np.float32(LEAKY_SLOPE) * hidden)
    return hidden @ w2 + b2


def logits(head: BakedHead, expression: np.ndarray) -> np.ndarray:
    """Logits (N, 4) float32 for an expression (B,): Ȳ + scale · Σ_k c_k(e) · basis[k]."""
    blend = np.tensordot(coefficients(head, expression), head.basis.astype(np.float32), 1)  # (N, 4)
    return head.mean_logits.astype(np.float32) + head.basis_scale[:, None] * blend


def centres(
    head: BakedHead, expression: np.ndarray, gaze: tuple[float, float] | None = None
) -> np.ndarray:
    """Centres for an expression: means + Σ_m d_m(e) · displacement_basis[m].

    Args:
        head: The baked head.
        expression: (B,).
        gaze: Radians by which its eyes are turned to the person's left, and downwards; None for a
            head whose eyes do not turn.

    Returns:
        (N, 3) float32 metres.
    """
    moved = steps(head, expression)  # (M,)
    if gaze is not None:
        moved[-2:] = EYE_UNIT * np.asarray(gaze, np.float32)
    return head.means + np.tensordot(moved, head.displacement_basis.astype(np.float32), 1)


def attributes(head: BakedHead, expression: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Colours and opacities of the Gaussians for an expression (B,).

    Returns:
        rgb (N, 3) and opacity (N,), float32 in [0, 1].
    """
    # The sigmoid, in the form that never overflows.
    values = 0.5 + 0.5 * np.tanh(0.5 * logits(head, expression))  # (N, 4)
    return values[:, :3], values[:, 3]
