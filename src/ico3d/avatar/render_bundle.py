"""Rendering baked avatars in Python: the picture that the page must show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from ico3d.avatar.avatar import Placement
from ico3d.avatar.baked_body import BakedBody, body_of, gaussians_at
from ico3d.bundle.evaluate import attributes, centres
from ico3d.bundle.format import Bundle
from ico3d.bundle.head import BakedHead
from ico3d.bundle.manifest import CameraInfo, GazeInfo
from ico3d.common.camera import Camera, look_at
from ico3d.common.files import full_disk
from ico3d.head.portrait.neck import bent
from ico3d.motion.composing.gaze import direction_to
from ico3d.splat import harmonics
from ico3d.splat.files.formats import read_gaussians
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render


def baked_gaussians(
    head: BakedHead, expression: np.ndarray, gaze: tuple[float, float] | None = None
) -> Gaussians:
    """The N Gaussians of a baked head for an expression (B,), in canonical head space.

    `gaze` is that of `ico3d.bundle.evaluate.centres`.
    """
    rgb, opacity = attributes(head, expression)
    return Gaussians(
        means=torch.from_numpy(centres(head, expression, gaze)),
        quats=torch.tensor(head.quats.astype(np.float32)),
        scales=torch.tensor(head.scales.astype(np.float32)).exp(),
        opacities=torch.from_numpy(opacity),
        colors=torch.from_numpy(rgb),
    )


def gaze_at(info: GazeInfo, head_from_world: np.ndarray, point: np.ndarray) -> tuple[float, float]:
    """How eyes are turned that look at a point, as far as they turn.

    Args:
        info: The manifest's entry about the head's eyes.
        head_from_world: (4, 4) rigid transform to canonical head space.
        point: (3,) metres in the world.

    Returns:
        Radians to the person's left, and downwards.
    """
    local = head_from_world[:3, :3] @ point + head_from_world[:3, 3]
    wanted = direction_to(np.array(info.eyes), local)
    yaw, pitch = np.clip(wanted, np.negative(info.most), info.most)
    return float(yaw), float(pitch)


def swaying_head(bundle: Bundle, expression: np.ndarray, row: float) -> Gaussians:
    """The head of a bundle without a body, in the world.

    Args:
        bundle: A bundle of a head alone.
        expression: (B,).
        row: At which of the head's poses, or between which.

    Raises:
        BundleError: If the bundle has no head.
    """
    head, poses = bundle.require_head()
    pose = pose_at(poses, row)
    return _bent(bundle, baked_gaussians(head, expression), pose, row).transform(pose)


def _bent(bundle: Bundle, gaussians: Gaussians, pose: np.ndarray, row: float) -> Gaussians:
    """A head's Gaussians in its space, with the shoulders where they are at a row of its poses."""
    if (shoulders := bundle.shoulders) is None:
        return gaussians
    motion = np.linalg.inv(pose) @ pose_at(shoulders.world_from_shoulders, row)
    share = torch.from_numpy(shoulders.share / np.float32(255))  # (N,)
    return bent(gaussians, share, torch.from_numpy(motion))


@dataclass(frozen=True)
class BakedAvatar:
    """A whole person as a viewer draws it.

    Attributes:
        head: The baked head, in the canonical head space that the head poses map to the world.
        body: The baked body.
        world_from_head: (F, 4, 4) rigid head pose in each frame of the body.
    """

    head: BakedHead
    body: BakedBody
    world_from_head: np.ndarray

    @staticmethod
    def of(bundle: Bundle) -> "BakedAvatar":
        """The person in a bundle.

        Raises:
            BundleError: If the bundle lacks the body or the head.
        """
        body = body_of(bundle)
        head, poses = bundle.require_head()
        return BakedAvatar(head, body, poses)

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.body.fps

    @property
    def seconds(self) -> float:
        """Length of the clip in seconds."""
        return self.body.windows[-1].last / self.fps

    def gaussians(self, seconds: float, expression: Sequence[float] | np.ndarray) -> Gaussians:
        """The whole person in the world, the body's Gaussians first.

        Args:
            seconds: Time in the body's clip, clamped to it; it also decides where the head is.
            expression: (B,).
        """
        head = baked_gaussians(self.head, np.asarray(expression, np.float32))
        pose = pose_at(self.world_from_head, seconds * self.fps)
        return cat([self.body_gaussians(seconds), head.transform(pose)])

    def body_gaussians(self, seconds: float) -> Gaussians:
        """The body alone, in the world, at a time of its clip."""
        return gaussians_at(self.body, seconds)


def pose_at(world_from_head: np.ndarray, frame: float) -> np.ndarray:
    """(4, 4) head pose at a frame, interpolated as by `Placement.pose`, from poses (F, 4, 4)."""
    return Placement(np.eye(4), world_from_head).pose(frame)


def body_gaussians(bundle: Bundle, seconds: float) -> Gaussians:
    """A bundle's body in the world at a time, which is clamped to the clip.

    Raises:
        BundleError: If the bundle has no body.
    """
    return gaussians_at(body_of(bundle), seconds)


def avatar_gaussians(
    bundle: Bundle, body_seconds: float, expression: Sequence[float] | np.ndarray
) -> Gaussians:
    """The whole person of a bundle; see `BakedAvatar.gaussians`.

    Raises:
        BundleError: If the bundle lacks the body or the head.
    """
    return BakedAvatar.of(bundle).gaussians(body_seconds, expression)


def backdrop_gaussians(bundle: Bundle) -> Gaussians | None:
    """The bundle's background splats in the world, with colours instead of spherical harmonics.

    Returns:
        The Gaussians; None where the bundle has no background splats.

    Raises:
        GaussianFileError: If the file of splats is damaged.
        StorageError: If temporary files have no room for it.
    """
    if bundle.background is None:
        return None
    with TemporaryDirectory() as folder:
        file = Path(folder) / bundle.background
        with full_disk(file):
            file.write_bytes(bundle.read(bundle.background))
        found = read_gaussians(file).with_degree(0).to_gaussians()
    assert found.sh is not None
    colors = (found.sh[:, 0] * harmonics.C0 + 0.5).clamp(min=0)  # (N, 3)
    return replace(found, sh=None, colors=colors)


def render_avatar(
    bundle: Bundle,
    body_seconds: float,
    expression: Sequence[float] | np.ndarray,
    camera: Camera,
    background: np.ndarray | None = None,
) -> np.ndarray:
    """Renders a whole person as a viewer does: (H, W, 3) float32 display RGB.

    Args:
        bundle: A bundle of a head and a body.
        body_seconds: Time in the body's clip, clamped to it.
        expression: (B,).
        camera: The camera in world space.
        background: (3,) or (H, W, 3) display RGB in [0, 1]; the bundle's own colour by default.

    Raises:
        BundleError: If the bundle lacks the body or the head.
    """
    behind = np.array(bundle.manifest.background) if background is None else background
    gaussians = avatar_gaussians(bundle, body_seconds, expression)
    with torch.no_grad():
        picture = render(gaussians, [camera], torch.tensor(behind).float()).rgb[0]
    return picture.numpy()  # (H, W, 3)


def render_body(bundle: Bundle, seconds: float, camera: Camera) -> np.ndarray:
    """Renders a bundle's body, without its head, as a viewer does.

    Args:
        bundle: A bundle of a body.
        seconds: Time in the body's clip, clamped to it.
        camera: The camera in world space.

    Returns:
        (H, W, 3) float32 display RGB before the bundle's own background colour.

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
    """Renders a bundle's head, without its body, as a viewer does.

    Args:
        bundle: A bundle of a head.
        expression: (B,).
        camera: The camera in world space.
        background: (3,) or (H, W, 3) display RGB in [0, 1]; the bundle's own colour by default.
        world_from_head: (4, 4) rigid head pose; the bundle's first one by default.

    Returns:
        (H, W, 3) float32 display RGB.

    Raises:
        BundleError: If the bundle has no head.
    """
    head, poses = bundle.require_head()
    pose = poses[0] if world_from_head is None else world_from_head
    behind = np.array(bundle.manifest.background) if background is None else background
    gaussians = _bent(bundle, baked_gaussians(head, np.asarray(expression, np.float32)), pose, 0.0)
    with torch.no_grad():
        picture = render(gaussians, [camera.moved(pose)], torch.tensor(behind).float()).rgb[0]
    return picture.numpy()  # (H, W, 3)


def visitor_camera(info: CameraInfo, width: int, height: int) -> Camera:
    """The manifest's camera as a pinhole camera with a picture of this size in pixels."""
    focal = 0.5 * height / np.tan(np.deg2rad(info.fov_y) / 2)
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    pose = look_at(np.array(info.eye), np.array(info.target), np.array(info.up))
    return Camera(width, height, intrinsics, pose, "visitor")
