"""How well a head sits on a body: the gap in space, and the seam in pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import binary_dilation
from scipy.spatial import KDTree

from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.joining.face_views import FaceView
from ico3d.avatar.joining.similarity import moved
from ico3d.capture.face.region import HeadRegion
from ico3d.common.camera import Camera, look_at
from ico3d.common.psnr import decibels
from ico3d.errors import CaptureError
from ico3d.splat.density import contributions
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render

RIM = 0.008
"""Depth in metres inside the border up to which the head's Gaussians count as its rim."""
OPAQUE = 0.3
"""Opacity above which a Gaussian of the body counts.

Also the summed contribution to one picture, in pixels, above which one of the head is visible.
"""
AROUND, DISTANCE, PIXELS, WIDE = 8, 1.2, 160, 0.4
"""Cameras around a head: number, distance in metres, side in pixels, and metres that it shows."""
BAND = 0.12
"""Width of the band on either side of the border in pictures, relative to the head's width."""
CERTAIN = 0.5
"""Share of a pixel above which it counts as head, or as person."""


def gap(
    head: Gaussians, body: Gaussians, world_from_head: np.ndarray, region: HeadRegion
) -> float | None:
    """The widest opening between a head's rim and a body, in metres.

    The opening at a visible Gaussian of the rim is the distance to the nearest opaque Gaussian of
    the body, less the largest standard deviation of each. The result is the median of the widest
    hundredth of these openings, as a single Gaussian makes no hole.

    Args:
        head: Gaussians of the head in the world.
        body: Gaussians of the body in the world.
        world_from_head: (4, 4) similarity that places the head.
        region: The part of the head's model that is drawn.

    Returns:
        Metres; None where the rim has no visible Gaussian, or the body no opaque one.
    """
    drawn, (head, body) = (head, body), (head.to("cpu"), body.to("cpu"))
    local = moved(np.linalg.inv(world_from_head), head.means.double().numpy())  # (N, 3)
    depth = region.depth(local)
    rim = (depth > 0) & (depth < RIM)
    rim[rim] = _seen_from_outside(*drawn)[rim]
    solid = body.opacities > OPAQUE
    if not rim.any() or not solid.any():
        return None
    distances, nearest = KDTree(body.means[solid].numpy()).query(head.means.numpy()[rim])
    sizes = head.scales.max(1).values.numpy(), body.scales[solid].max(1).values.numpy()
    opening = np.sort((distances - sizes[0][rim] - sizes[1][nearest]).clip(min=0))
    return float(np.median(opening[-max(len(opening) // 100, 1) :]))


def _seen_from_outside(head: Gaussians, body: Gaussians) -> np.ndarray:
    """(N,) bool: which Gaussians of a head are visible to cameras around it, body included."""
    middle = head.means.mean(0).double().cpu().numpy()
    cameras = [_looking_at(middle, angle) for angle in np.arange(AROUND) * 2 * np.pi / AROUND]
    given = contributions(cat([head, body]), cameras)[:, : len(head)]  # (C, N)
    return (given.max(0).values > OPAQUE).cpu().numpy()


def _looking_at(middle: np.ndarray, angle: float) -> Camera:
    """A camera level with a head at `middle` (3,), at an azimuth in radians, with +y up."""
    eye = middle + DISTANCE * np.array([np.sin(angle), 0.0, np.cos(angle)])
    focal = PIXELS * DISTANCE / WIDE
    intrinsics = np.array([[focal, 0, PIXELS / 2], [0, focal, PIXELS / 2], [0, 0, 1]])
    return Camera(PIXELS, PIXELS, intrinsics, look_at(eye, middle), "around")


def largest_gap(avatar: TrainedAvatar, region: HeadRegion) -> float | None:
    """The widest `gap` in any frame of the clip, metres; None if no frame has one to measure."""
    gaps = []
    for frame in range(len(avatar.placement.world_from_canonical)):
        seconds = frame / avatar.fps
        with torch.no_grad():
            body = avatar.body.gaussians(seconds)
        where = avatar.placement.world_from_head(frame)
        gaps.append(gap(avatar.head_gaussians(seconds), body, where, region))
    return max((width for width in gaps if width is not None), default=None)


@dataclass(frozen=True)
class SeamScores:
    """How rendered pictures differ from recorded ones near the border of head and body.

    Attributes:
        psnr_face: PSNR in dB of the head without the band along the border.
        psnr_border: PSNR in dB of the band along the border.
        color_step: Change of the mean colour across the border, less that in the recorded picture:
            length of the RGB vector, mean over views.
    """

    psnr_face: float
    psnr_border: float
    color_step: float


def seam_scores(avatar: TrainedAvatar, views: Sequence[FaceView]) -> SeamScores:
    """Compares an avatar with recorded pictures of its face.

    Args:
        avatar: The avatar; it is drawn with the recorded expressions.
        views: Recorded pictures of the face.

    Raises:
        CaptureError: If no view shows the border.
    """
    found = [scores for view in views if (scores := _scores_of(avatar, view)) is not None]
    if not found:
        raise CaptureError("no picture shows the border between head and body.")
    errors = np.mean([scores[:2] for scores in found], axis=0)  # (2,)
    face, border = (decibels(float(error)) for error in errors)
    return SeamScores(face, border, float(np.mean([s[2] for s in found])))


@torch.no_grad()
def _scores_of(avatar: TrainedAvatar, view: FaceView) -> tuple[float, float, float] | None:
    """Mean squared errors of face and border, and the colour step; None without a border."""
    seconds = view.frame / avatar.fps
    head, body = avatar.head_gaussians(seconds), avatar.body.gaussians(seconds)
    drawn = render(cat([body, head]), [view.camera], view.image).rgb[0].cpu().numpy()  # (H, W, 3)
    inner, outer, face = _bands(_share(head, body, view), view.mask.numpy() > CERTAIN)
    if not inner.any() or not outer.any() or not face.any():
        return None
    truth = view.image.numpy()
    squares = np.square(drawn - truth).mean(-1)  # (H, W)
    step = (drawn - truth)[inner].mean(0) - (drawn - truth)[outer].mean(0)  # (3,)
    errors = squares[face].mean(), squares[inner | outer].mean()
    return float(errors[0]), float(errors[1]), float(np.linalg.norm(step))


def _share(head: Gaussians, body: Gaussians, view: FaceView) -> np.ndarray:
    """(H, W) share of each pixel, 0 to 1, that the head covers in front of the body."""
    white, black = torch.ones_like(head.means), torch.zeros_like(body.means)
    marked = cat([body.painted(black), head.painted(white)])
    return render(marked, [view.camera]).rgb[0, :, :, 0].cpu().numpy()


def _bands(share: np.ndarray, person: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Divides a picture near the border of head and body.

    Args:
        share: (H, W) share of each pixel that the head covers.
        person: (H, W) bool mask of the person.

    Returns:
        (H, W) bool each: the head's side of the band along the border, the body's side of it, and
        the rest of the head.
    """
    head = (share > CERTAIN) & person
    body = (share < 1 - CERTAIN) & person
    columns = np.flatnonzero(head.any(0))
    width = columns[-1] - columns[0] + 1 if len(columns) else 0
    reach = max(round(BAND * width), 2)
    inner = head & np.asarray(binary_dilation(body, iterations=reach), bool)
    outer = body & np.asarray(binary_dilation(head, iterations=reach), bool)
    return inner, outer, head & ~inner
