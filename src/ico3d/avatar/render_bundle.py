"""Rendering baked avatars in Python: the picture that the page must show."""

from collections.abc import Sequence

import numpy as np
import torch

from ico3d.avatar.avatar import Placement
from ico3d.bundle.body import BakedWindow
from ico3d.bundle.evaluate import attributes
from ico3d.bundle.format import Bundle
from ico3d.bundle.head import BakedHead
from ico3d.bundle.manifest import CameraInfo
from ico3d.common.camera import Camera, look_at
from ico3d.errors import BundleError
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render


def baked_gaussians(head: BakedHead, expression: np.ndarray) -> Gaussians:
    """The Gaussians (N) of an expression (B,) in canonical head space."""
    rgb, opacity = attributes(head, expression)
    return Gaussians(
        means=torch.tensor(head.means),
        quats=torch.tensor(head.quats.astype(np.float32)),
        scales=torch.tensor(head.scales.astype(np.float32)).exp(),
        opacities=torch.from_numpy(opacity),
        colors=torch.from_numpy(rgb),
    )


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


def body_gaussians(bundle: Bundle, seconds: float) -> Gaussians:
    """The body at a time; before its first and after its last frame it stands still.

    Raises:
        BundleError: If the bundle has no body.
    """
    body = bundle.manifest.body
    if body is None:
        raise BundleError("this bundle has no body.")
    frame = min(max(seconds * body.fps, 0.0), body.windows[-1].last)
    index = next(i for i, window in enumerate(body.windows) if frame <= window.last)
    window = body.windows[index]
    tau = (frame - window.first) / (window.last - window.first)
    return window_gaussians(bundle.window(index), tau)


def avatar_gaussians(
    bundle: Bundle, body_seconds: float, expression: Sequence[float] | np.ndarray
) -> Gaussians:
    """The whole person in the world, the body's Gaussians first; the body's time places the head.

    Args:
        bundle: Of a head and a body.
        body_seconds: Where in the body's motion; clamped to it.
        expression: (B,).

    Raises:
        BundleError: If the bundle lacks the body or the head.
    """
    body = body_gaussians(bundle, body_seconds)
    head, poses = bundle.require_head()
    assert bundle.manifest.body is not None
    drawn = baked_gaussians(head, np.asarray(expression, np.float32))
    pose = pose_at(poses, body_seconds * bundle.manifest.body.fps)
    return cat([body, drawn.transform(pose)])


def pose_at(world_from_head: np.ndarray, frame: float) -> np.ndarray:
    """(4, 4) of poses (F, 4, 4) at a frame of the body, as a viewer places the head."""
    return Placement(np.eye(4), world_from_head).pose(frame)


def render_avatar(
    bundle: Bundle,
    body_seconds: float,
    expression: Sequence[float] | np.ndarray,
    camera: Camera,
    background: np.ndarray | None = None,
) -> np.ndarray:
    """Renders a whole person as a viewer does: (H, W, 3) float32 display RGB.

    Args:
        bundle: Of a head and a body.
        body_seconds: Where in the body's motion.
        expression: (B,).
        camera: In world space.
        background: (3,) or (H, W, 3); the bundle's own colour by default.

    Raises:
        BundleError: If the bundle lacks the body or the head.
    """
    behind = np.array(bundle.manifest.background) if background is None else background
    gaussians = avatar_gaussians(bundle, body_seconds, expression)
    with torch.no_grad():
        picture = render(gaussians, [camera], torch.tensor(behind).float()).rgb[0]
    return picture.numpy()  # (H, W, 3)


def render_body(bundle: Bundle, seconds: float, camera: Camera) -> np.ndarray:
    """Renders a bundle's body as a viewer does: (H, W, 3) float32 display RGB.

    Raises:
        BundleError: If the bundle has no body.
    """
    behind = torch.tensor(bundle.manifest.background)
    with torch.no_grad():
        picture = render(body_gaussians(bundle, seconds), [camera], behind).rgb[0]
    return picture.numpy()  # (H, W, 3)


def render_bundle(
    bundle: Bundle,
    expression: Sequence[float] | np.ndarray,
    camera: Camera,
    background: np.ndarray | None = None,
    world_from_head: np.ndarray | None = None,
) -> np.ndarray:
    """Renders a bundle's head as a viewer does.

    Args:
        bundle: The avatar.
        expression: (B,).
        camera: In world space.
        background: (3,) or (H, W, 3); the bundle's own colour by default.
        world_from_head: (4, 4); the bundle's first head pose by default.

    Returns:
        (H, W, 3) float32 display RGB.

    Raises:
        BundleError: If the bundle has no head.
    """
    head, poses = bundle.require_head()
    pose = poses[0] if world_from_head is None else world_from_head
    behind = np.array(bundle.manifest.background) if background is None else background
    gaussians = baked_gaussians(head, np.asarray(expression, np.float32))
    with torch.no_grad():
        picture = render(gaussians, [camera.moved(pose)], torch.tensor(behind).float()).rgb[0]
    return picture.numpy()  # (H, W, 3)


def visitor_camera(info: CameraInfo, width: int, height: int) -> Camera:
    """The manifest's camera as a pinhole camera of this size."""
    focal = 0.5 * height / np.tan(np.deg2rad(info.fov_y) / 2)
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    pose = look_at(np.array(info.eye), np.array(info.target), np.array(info.up))
    return Camera(width, height, intrinsics, pose, "visitor")
