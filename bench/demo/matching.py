"""What the body has learnt behind the head, in the colours of the head that lies before it.

The cameras of a whole body see hair and ears as well. What they taught fills the back of the head,
where the head's own cameras did not look. In front it is hidden under the head, or almost: between
strands of hair a single Gaussian of it was a dark spot, another a red streak at the temple.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree
from scipy.special import logit

from ico3d.avatar.embodying.surfaces import main_joints
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.splat.gaussians import Gaussians

JOINT = "head"
"""The joint that carries what the body has of the head."""
NEAR, NEAREST = 0.01, 0.005
"""Metres within which the head's Gaussians tell what colour is there, and where they do most."""
ENOUGH = 0.5
"""Area of the head's Gaussians, as a share of that of a disc of radius `NEAR`, from which on the
head has a surface there."""
SEEN = 0.15
"""Least opacity of Gaussians that tell."""


def matched(
    body: BakedSkinned, shown: Callable[[BakedSkinned], Gaussians], head: Gaussians
) -> BakedSkinned:
    """The body with the head's colours where it lies at the head's surface.

    Args:
        body: N Gaussians.
        shown: Returns a body's N in the world, in one pose.
        head: The head's M Gaussians in the world, at the same time.
    """
    named = np.array([name == JOINT for name in body.rig.names])
    behind = np.flatnonzero(named[main_joints(body)])  # (n,)
    posed = shown(body)
    told, share = _told(posed.means[behind].double().numpy(), head)  # (n, 3), (n,)
    was = _colours(posed)[behind]
    shapes = body.shapes.astype(np.float64)
    shapes[behind, :, 3:] *= 1 - share[:, None, None]
    stiller = replace(body, shapes=np.round(shapes).astype(np.int8))
    logits = body.color_logits.astype(np.float64)
    wanted = was + share[:, None] * (told - was)
    logits[behind] += _logit(wanted) - _logit(_colours(shown(stiller))[behind])
    return replace(stiller, color_logits=logits.astype(np.float16))


def _told(points: np.ndarray, head: Gaussians) -> tuple[np.ndarray, np.ndarray]:
    """The head's colours (n, 3) at points (n, 3), and how much (n,) of a surface it has there."""
    opacities = head.opacities.double().numpy().reshape(-1)  # (M,)
    seen = opacities > SEEN
    means, colours = head.means[seen].double().numpy(), _colours(head)[seen]
    across = np.sort(head.scales[seen].double().numpy(), axis=1)[:, 1:]  # (m, 2)
    area = opacities[seen] * across.prod(1) * np.pi  # (m,)
    told, surface = np.full((len(points), 3), 0.5), np.zeros(len(points))
    for index, near in enumerate(KDTree(means).query_ball_point(points, NEAR)):
        if near:
            apart = np.linalg.norm(means[near] - points[index], axis=1)
            weights = area[near] * np.exp(-0.5 * (apart / NEAREST) ** 2)
            told[index] = np.average(colours[near], axis=0, weights=weights)
            surface[index] = area[near].sum() / (np.pi * NEAR**2)
    return told, np.clip(surface / ENOUGH, 0, 1)


def _colours(gaussians: Gaussians) -> np.ndarray:
    assert gaussians.colors is not None
    return gaussians.colors.double().numpy()


def _logit(colours: np.ndarray) -> np.ndarray:
    return logit(np.clip(colours, 1e-6, 1 - 1e-6))
