"""A slow rasteriser in float64 torch that spells the convention out; autograd gives gradients."""

import numpy as np
import torch

from ico3d.common.camera import Camera, look_at
from ico3d.splat import convention, harmonics, quaternions


def camera_at(eye, width=44, height=30, focal=55.0, name="0"):
    intrinsics = np.array(
        [[focal, 0, width / 2 + 1.5], [0, focal * 1.1, height / 2 - 2], [0, 0, 1]]
    )
    return Camera(width, height, intrinsics, look_at(np.array(eye), np.zeros(3)), name)


def project(gaussians, camera, view=None, antialiased=True):
    """Means2d (N, 2), 2D covariances (N, 2, 2) after the blur, opacities left (N,), depths (N,)."""
    view = torch.from_numpy(camera.world_to_camera) if view is None else view  # (4, 4)
    k = camera.intrinsics
    local = gaussians.means @ view[:3, :3].T + view[:3, 3]  # (N, 3)
    x, y, z = local.unbind(-1)
    z = torch.where(z < convention.NEAR, torch.ones_like(z), z)  # not drawn; keeps this finite
    slopes = []
    for slope, focal, center, size in (
        (x / z, k[0, 0], k[0, 2], camera.width),
        (y / z, k[1, 1], k[1, 2], camera.height),
    ):
        margin = convention.FRUSTUM_MARGIN * 0.5 * size / focal
        slopes.append(slope.clamp(-center / focal - margin, (size - center) / focal + margin))
    zero = torch.zeros_like(z)
    jacobian = torch.stack(
        [
            torch.stack([k[0, 0] / z, zero, -k[0, 0] * slopes[0] / z], -1),
            torch.stack([zero, k[1, 1] / z, -k[1, 1] * slopes[1] / z], -1),
        ],
        -2,
    )  # (N, 2, 3)
    root = jacobian @ view[:3, :3] @ quaternions.to_matrix(gaussians.quats)
    root = root * gaussians.scales[:, None]  # (N, 2, 3)
    sharp = root @ root.mT  # (N, 2, 2)
    blurred = sharp + convention.BLUR * torch.eye(2, dtype=sharp.dtype)
    left = gaussians.opacities
    if antialiased:
        left = left * (torch.linalg.det(sharp) / torch.linalg.det(blurred)).sqrt()
    left = torch.where(local[:, 2] < convention.NEAR, torch.zeros_like(left), left)
    means2d = torch.stack([k[0, 0] * x / z + k[0, 2], k[1, 1] * y / z + k[1, 2]], -1)
    return means2d, blurred, left, local[:, 2]


def composite(means2d, covariances, opacities, depths, features, width, height):
    """Features (N, F) to pixels (H, W, F), and the transmittance (H, W)."""
    order = depths.detach().argsort(stable=True)
    rows, columns = torch.meshgrid(
        torch.arange(height) + 0.5, torch.arange(width) + 0.5, indexing="ij"
    )
    pixels = torch.stack([columns, rows], -1).double()  # (H, W, 2)
    color = torch.zeros(height, width, features.shape[-1], dtype=torch.float64)
    light = torch.ones(height, width, dtype=torch.float64)
    going = torch.ones(height, width, dtype=torch.bool)
    for i in order.tolist():
        offset = pixels - means2d[i]  # (H, W, 2)
        exponent = 0.5 * ((offset @ torch.linalg.inv(covariances[i])) * offset).sum(-1)
        alpha = (opacities[i] * torch.exp(-exponent)).clamp_max(convention.MAX_ALPHA)
        alpha = torch.where(alpha >= convention.MIN_ALPHA, alpha, torch.zeros_like(alpha))
        going = going & (light * (1 - alpha) > convention.MIN_TRANSMITTANCE)
        alpha = torch.where(going, alpha, torch.zeros_like(alpha))
        color = color + (light * alpha)[..., None] * features[i]
        light = light * (1 - alpha)
    return color, light


def seen_colors(gaussians, view):
    """Colours (N, 3) that a camera sees."""
    if gaussians.sh is None:
        return gaussians.colors
    eye = -view[:3, :3].T @ view[:3, 3]  # (3,)
    return harmonics.to_colors(gaussians.sh, gaussians.means - eye)


def render(gaussians, cameras, background=None, world_to_camera=None, antialiased=True):
    """rgb (C, H, W, 3), alpha (C, H, W), expected depth (C, H, W) of float64 Gaussians."""
    images = []
    if world_to_camera is None:
        world_to_camera = torch.from_numpy(np.stack([c.world_to_camera for c in cameras]))
    for camera, view in zip(cameras, world_to_camera, strict=True):
        means2d, covariances, opacities, depths = project(gaussians, camera, view, antialiased)
        features = torch.cat([seen_colors(gaussians, view), depths[:, None]], -1)  # (N, 4)
        size = (camera.width, camera.height)
        color, light = composite(means2d, covariances, opacities, depths, features, *size)
        images.append(torch.cat([color, light[..., None]], -1))  # (H, W, 5)
    stacked = torch.stack(images)  # (C, H, W, 5)
    rgb, depth, light = stacked[..., :3], stacked[..., 3], stacked[..., 4]
    if background is not None:
        rgb = rgb + light[..., None] * background
    return rgb, 1 - light, depth / (1 - light).clamp_min(1e-10)


def scene(count, seed=0, spread=0.35, dtype=torch.float64):
    """Random Gaussians around the origin, of every size, some of them nearly opaque."""
    from ico3d.splat.gaussians import Gaussians

    random = np.random.default_rng(seed)
    values = (
        random.uniform(-spread, spread, (count, 3)),
        random.normal(size=(count, 4)),
        np.exp(random.uniform(np.log(0.004), np.log(0.15), (count, 3))),
        np.where(random.random(count) < 0.2, 0.9999, random.uniform(0.05, 0.95, count)),
        random.random((count, 3)),
    )
    return Gaussians(*(torch.from_numpy(value).to(dtype) for value in values))


def harmonic(gaussians, coefficients, seed=0):
    """The same Gaussians with random harmonics, bright enough not to be cut at 0."""
    from ico3d.splat.gaussians import Gaussians

    if not coefficients:
        return gaussians
    random = np.random.default_rng(seed)
    sh = 0.15 * random.normal(size=(len(gaussians), coefficients, 3))
    sh[:, 0] += 2
    values = {name: value for name, value in vars(gaussians).items() if name != "colors"}
    return Gaussians(**values | {"sh": torch.from_numpy(sh).to(gaussians.means)})
