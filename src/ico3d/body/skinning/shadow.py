"""The shadow that a body casts on itself in the light of one distant lamp."""

import torch
from torch import Tensor
from torch.nn.functional import embedding_bag

from ico3d.body.skinning import shadow_kernels
from ico3d.rig.shadow_map import BIAS, EDGE, FAR, OFF, RADIUS, SIDE, TEXEL


def posed_casters(table: Tensor, points: Tensor, joints: Tensor, weights: Tensor) -> Tensor:
    """(M, 3) where the spheres' centres are in the world.

    Args:
        table: (J, 16) of `ico3d.body.skinning.kinematics.transforms`.
        points: (M, 3) metres at rest.
        joints: (M, 4) int32, which joints carry a sphere.
        weights: (M, 4).
    """
    mixed = embedding_bag(joints, table[:, :12], mode="sum", per_sample_weights=weights)  # (M, 12)
    turned = mixed[:, :9].unflatten(1, (3, 3))  # (M, 3, 3)
    return (turned * points[:, None]).sum(2) + mixed[:, 9:]


@torch.no_grad()
def reached(points: Tensor, normals: Tensor, casters: Tensor, direction: Tensor) -> Tensor:
    """How much of a distant lamp's light reaches points on a body.

    Spheres are drawn into a depth map as the lamp sees them; a point looks at the 4 × 4 texels
    about it. Nothing learns by it.

    Args:
        points: (N, 3) metres in the world.
        normals: (N, 3) unit vectors out of the body.
        casters: (M, 3) centres of the spheres, metres in the world.
        direction: (3,) unit vector towards the lamp.

    Returns:
        (N,) from 0 in full shadow to 1.
    """
    axes = lamp_axes(direction)  # (3, 3)
    spheres = (casters @ axes.T).contiguous()  # (M, 3)
    places = ((points + OFF * normals) @ axes.T).contiguous()  # (N, 3)
    if places.device.type == "cpu" and places.dtype == torch.float32:
        depths = places.new_full((SIDE, SIDE), FAR)
        shares = places.new_empty(len(places))
        size = RADIUS / TEXEL, TEXEL
        shadow_kernels.draw(spheres.numpy(), *size, depths.numpy())
        depth = BIAS, EDGE
        shadow_kernels.look_up(places.numpy(), depths.numpy(), TEXEL, *depth, shares.numpy())
        return shares
    return _looked_up(places, _drawn(spheres))


def lamp_axes(direction: Tensor) -> Tensor:
    """(3, 3) rows: across, up and towards a lamp in the direction (3,), of length 1."""
    up = direction.new_tensor([0.0, 1.0, 0.0] if abs(float(direction[1])) < 0.99 else [0, 0, 1.0])
    across = torch.nn.functional.normalize(torch.linalg.cross(up, direction), dim=0)
    return torch.stack([across, torch.linalg.cross(direction, across), direction])


def _drawn(spheres: Tensor) -> Tensor:
    """(SIDE · SIDE,) how far towards the lamp the nearest of spheres (M, 3) reaches."""
    reach = int(RADIUS / TEXEL) + 1
    steps = torch.arange(-reach, reach + 1, device=spheres.device)
    columns, rows = torch.meshgrid(steps, steps, indexing="xy")  # (S, S) each
    offsets = torch.stack([columns.flatten(), rows.flatten()], 1)  # (S², 2)
    texels = torch.round(spheres[:, None, :2] / TEXEL).long() + offsets  # (M, S², 2)
    apart = (texels * TEXEL - spheres[:, None, :2]).square().sum(2)  # (M, S²)
    inside = apart <= RADIUS**2
    depth = spheres[:, None, 2] + (RADIUS**2 - apart).clamp_min(0).sqrt()  # (M, S²)
    depths = spheres.new_full((SIDE * SIDE,), FAR)
    return depths.scatter_reduce_(0, _index(texels)[inside], depth[inside], "amax")


def _looked_up(places: Tensor, depths: Tensor) -> Tensor:
    """(N,) share of the texels about places (N, 3) that are not before them, nearer ones more."""
    scaled = places[:, :2] / TEXEL  # (N, 2)
    corner = scaled.floor()
    share = places.new_zeros(len(places))
    for down in range(-1, 3):
        for right in range(-1, 3):
            texel = corner + corner.new_tensor([right, down])  # (N, 2)
            weight = (1 - (scaled - texel).abs() / 2).prod(1) / 4  # (N,)
            before = places[:, 2] + BIAS - depths[_index(texel.long())]  # (N,)
            share = share + weight * (before / EDGE + 0.5).clamp(0, 1)
    return share


def _index(texels: Tensor) -> Tensor:
    """(...) places in the flat map of texels (..., 2), which repeat."""
    wrapped = texels % SIDE
    return wrapped[..., 1] * SIDE + wrapped[..., 0]
