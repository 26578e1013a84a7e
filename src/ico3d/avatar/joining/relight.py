"""Puts a head into the light of the body's studio (paper, head–body integration).

The paper lets the last layer of the head's network learn colours. Pictures of a whole person show
the face in a few hundred pixels, from which such a layer learns blotches. Here light alone changes:
a gain and a smooth shading (`light_change`) on normals of the head (`normals`), the same in every
expression. It is found once, before the body's windows are trained with this head.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import gaussian_filter
from torch import Tensor

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.face_views import FaceView
from ico3d.avatar.joining.light_change import bounds, improved, no_change
from ico3d.avatar.joining.normals import surface_normals
from ico3d.capture.face.region import JAW_ENDS
from ico3d.head.model import HeadModel
from ico3d.splat import harmonics
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

CERTAIN = 0.5
"""Share of a pixel that both head and person must cover for the pixel to count."""
BLUR = 2.0
"""Standard deviation in pixels by which pictures are blurred, as heads sit a pixel beside."""
ROUNDS = 6
"""Number of times that the head is drawn and the change of its light improved."""


@dataclass(frozen=True)
class _Pixels:
    """What of one view stays the same while light changes.

    Attributes:
        view: The view.
        seen: (H, W, 3) the recorded picture, blurred.
        basis: (H, W, 9) harmonics of the normals, blurred.
        weight: (H, W) 1 where head and person are, else 0. Mouth and eyes count: 27 numbers cannot
            draw an expression, and without the chin nothing is known of light from below.
    """

    view: FaceView
    seen: np.ndarray
    basis: np.ndarray
    weight: np.ndarray


def relit(
    model: HeadModel,
    landmarks: np.ndarray,
    placement: Placement,
    expressions: np.ndarray,
    views: Sequence[FaceView],
) -> HeadModel:
    """The head in the light in which pictures of the body's capture were taken.

    Args:
        model: The head.
        landmarks: (68, 3) landmarks of its face, in its space.
        placement: Where the head is in each frame.
        expressions: (F, B) expression in each frame of the body's recording.
        views: Pictures of the face in the body's recording.
    """
    views = [view.to(model.device) for view in views]
    basis = harmonics_of(model, landmarks, expressions[views[0].frame])  # (N, 9)
    pixels = [_pixels(_placed(model, placement, expressions, v.frame), basis, v) for v in views]
    stacked = np.concatenate([p.basis[p.weight > 0] for p in pixels])  # (P, 9)
    weight = np.concatenate([p.weight[p.weight > 0] for p in pixels])  # (P,)
    seen = np.concatenate([p.seen[p.weight > 0] for p in pixels])  # (P, 3)
    change = no_change()
    for _ in range(ROUNDS):
        now = model.relit(basis @ torch.from_numpy(change).to(basis))
        drawn = [_drawn(_placed(now, placement, expressions, p.view.frame), p) for p in pixels]
        change = improved(change, np.concatenate(drawn), seen, stacked, weight)
    least, most = torch.from_numpy(bounds(change, stacked, weight)).to(basis)  # (3,) each
    return model.relit((basis @ torch.from_numpy(change).to(basis)).clamp(least, most))


@torch.no_grad()
def harmonics_of(model: HeadModel, landmarks: np.ndarray, expression: np.ndarray) -> Tensor:
    """(N, 9) harmonics up to degree 2 of the normals of a head's Gaussians.

    Args:
        model: The head.
        landmarks: (68, 3) landmarks of its face, in its space.
        expression: (B,) an expression; the Gaussians that are opaque in it make up the surface.
    """
    shown = model(torch.from_numpy(expression))
    middle = landmarks[list(JAW_ENDS)].mean(0)  # between the ears
    places = shown.means.cpu().numpy(), shown.opacities.cpu().numpy()
    normals = torch.from_numpy(surface_normals(*places, middle))  # (N, 3)
    return harmonics.basis(normals, 2).to(shown.means)


@torch.no_grad()
def color_difference(
    model: HeadModel, placement: Placement, expressions: np.ndarray, views: Sequence[FaceView]
) -> float:
    """Mean absolute RGB difference, in [0, 1], between head and pictures where both show the head.

    Mouth and eyes, which expressions change, do not count.

    Args:
        model: The head.
        placement: Where the head is in each frame.
        expressions: (F, B) expression in each frame of the body's recording.
        views: Pictures of the face in the body's recording.
    """
    found = []
    for view in (view.to(model.device) for view in views):
        drawn = _placed(model, placement, expressions, view.frame)
        rendering = render(drawn, [view.camera], view.image)
        weight = _covered(rendering.alpha[0], view) * view.steady  # (H, W)
        difference = (rendering.rgb[0] - view.image).abs().mean(-1)  # (H, W)
        found.append(float((difference * weight).sum() / weight.sum().clamp_min(1)))
    return float(np.mean(found))


@torch.no_grad()
def _placed(
    model: HeadModel, placement: Placement, expressions: np.ndarray, frame: int
) -> Gaussians:
    """The head in the world at a frame."""
    return model(torch.from_numpy(expressions[frame])).transform(placement.world_from_head(frame))


def _covered(alpha: Tensor, view: FaceView) -> Tensor:
    """(H, W) 1 where head and person are, else 0."""
    return ((alpha > CERTAIN) & (view.mask > CERTAIN)).to(alpha)


@torch.no_grad()
def _pixels(drawn: Gaussians, basis: Tensor, view: FaceView) -> _Pixels:
    """What of a view stays the same, with the head's Gaussians in the world."""
    parts = [render(drawn.painted(basis[:, i : i + 3]), [view.camera]) for i in (0, 3, 6)]
    weight = _covered(parts[0].alpha[0], view).cpu().numpy()  # (H, W)
    stacked = torch.cat([part.rgb[0] for part in parts], 2).cpu().numpy()  # (H, W, 9)
    seen = _blurred(view.image.cpu().numpy(), weight)  # (H, W, 3)
    return _Pixels(view, seen, _blurred(stacked, weight), weight)


@torch.no_grad()
def _drawn(drawn: Gaussians, pixels: _Pixels) -> np.ndarray:
    """(P, 3) blurred colours of the pixels that count, with the head's Gaussians in the world."""
    rgb = render(drawn, [pixels.view.camera], pixels.view.image).rgb[0].cpu().numpy()  # (H, W, 3)
    return _blurred(rgb, pixels.weight)[pixels.weight > 0]


def _blurred(picture: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """A picture (H, W, C), blurred within the pixels that count, so that none other runs in."""
    share = gaussian_filter(weight, BLUR)[..., None]  # (H, W, 1)
    spread = gaussian_filter(picture * weight[..., None], (BLUR, BLUR, 0))  # (H, W, C)
    return spread / np.maximum(share, 1e-6)
