"""Baked bodies, of windows or on a skeleton, as Gaussians in the world."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
import torch

from ico3d.avatar.moving import Span, tau_in
from ico3d.bundle.format import Bundle
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.posing import SkinnedPose, posed, recorded_pose
from ico3d.bundle.windows.baked import BakedWindow
from ico3d.errors import BundleError
from ico3d.splat.gaussians import Gaussians


class BakedBody(Protocol):
    """A baked body that can be drawn at any time of its clip."""

    @property
    def fps(self) -> float:
        """Frames per second."""
        ...

    @property
    def windows(self) -> Sequence[Span]:
        """Spans of time with Gaussians of their own; neighbours share one frame."""
        ...

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """The Gaussians of a window in the world, τ in [0, 1]."""
        ...


@dataclass(frozen=True)
class WindowedBody:
    """A `BakedBody` that consists of windows.

    Attributes:
        window: Returns the baked window of an index.
        windows: First and last frame of each window.
        fps: Frames per second.
    """

    window: Callable[[int], BakedWindow]
    windows: Sequence[Span]
    fps: float

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """The Gaussians of a window in the world, τ in [0, 1]."""
        return window_gaussians(self.window(index), tau)


@dataclass(frozen=True)
class WholeClip:
    """A `Span` that covers a whole clip: from frame 0 to `last`."""

    last: int
    first: int = 0


@dataclass(frozen=True)
class SkinnedBody:
    """A `BakedBody` on a skeleton that repeats its recorded motion, as one window.

    Attributes:
        baked: The body as the bundle holds it.
    """

    baked: BakedSkinned

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.baked.info.fps

    @property
    def windows(self) -> Sequence[Span]:
        """One span, which is the whole clip."""
        return (WholeClip(self.baked.info.num_frames - 1),)

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """The Gaussians in the world, in the recorded pose at τ in [0, 1] of the clip.

        Args:
            index: 0, the only window.
            tau: Time in the clip, 0 at the first frame and 1 at the last.
        """
        frame = tau * self.windows[index].last
        return skinned_gaussians(self.baked, recorded_pose(self.baked, frame))


def body_of(bundle: Bundle) -> WindowedBody | SkinnedBody:
    """The body in a bundle; each window is read when it is first drawn.

    Raises:
        BundleError: If the bundle has no body.
    """
    if bundle.skinned is not None:
        return SkinnedBody(bundle.skinned)
    body = bundle.manifest.body
    if body is None:
        raise BundleError(f"the bundle of '{bundle.manifest.name}' has no body.")
    return WindowedBody(lru_cache(maxsize=2)(bundle.window), body.windows, body.fps)


def gaussians_at(body: BakedBody, seconds: float) -> Gaussians:
    """A body in the world at a time in seconds, which is clamped to the clip."""
    return body.window_gaussians(*place_in(body.windows, seconds * body.fps))


def place_in(spans: Sequence[Span], frame: float) -> tuple[int, float]:
    """Which window shows a frame, and when in that window.

    Args:
        spans: The windows, in order of time.
        frame: Need not be whole; it is clamped to the clip.

    Returns:
        Index of the window, and τ in [0, 1].
    """
    frame = min(max(frame, 0.0), spans[-1].last)
    index = next(i for i, span in enumerate(spans) if frame <= span.last)
    return index, tau_in(spans[index], frame)


def window_gaussians(window: BakedWindow, tau: float) -> Gaussians:
    """The Gaussians (N) of a window of the body at τ in [0, 1], in the world."""
    means, quats, scales = window.at(tau)
    rgba = torch.from_numpy(window.rgba / np.float32(255))
    return Gaussians(
        means=torch.from_numpy(means),
        quats=torch.from_numpy(quats),
        scales=torch.from_numpy(scales),
        opacities=rgba[:, 3],
        colors=rgba[:, :3],
    )


def skinned_gaussians(
    baked: BakedSkinned, pose: SkinnedPose, count: int | None = None
) -> Gaussians:
    """The Gaussians of a body on a skeleton in any pose, in the world.

    Args:
        baked: The body.
        pose: Pose of the skeleton, with the coefficients of the residual shapes.
        count: Number of Gaussians, the most important ones; by default all N.
    """
    found = posed(baked, pose, count)
    return Gaussians(
        means=torch.from_numpy(found.means),
        quats=torch.from_numpy(found.quats),
        scales=torch.from_numpy(found.scales),
        opacities=torch.from_numpy(found.opacities),
        colors=torch.from_numpy(found.rgb),
    )
