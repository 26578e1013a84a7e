"""How far the two backends are apart: pictures, and every gradient."""

import numpy as np
import torch
from torch import Tensor

from full_size.models import ball, camera
from ico3d.protocols.report import Column, Value
from ico3d.splat.device import CPU
from ico3d.splat.render import render

VALUES, GRADIENTS = 1e-4, 1e-3
"""Greatest differences between the backends, relative to the largest value."""
RIMS = 0.002
"""Share of the numbers that may differ more: a pixel at a splat's rim is drawn with alpha 1/255, or
not at all, by the last bit of its distance."""
PICTURE = ("rgb", "alpha", "depth")
COLUMNS = (
    Column("half", "median", 8),
    Column("most", "99 %", 8),
    Column("bounded", f"{100 * (1 - RIMS):g} %", 8),
    Column("all", "greatest", 8),
    Column("bound", f"bound of the {100 * (1 - RIMS):g} %", 8),
    Column("kept", "kept"),
)


def parity_rows(device: torch.device, count: int, size: int) -> list[dict[str, Value]]:
    """Quantiles of the differences between a device and the CPU, relative to the largest value.

    Args:
        device: The device to compare with the CPU.
        count: Number of Gaussians.
        size: Side of the two pictures, pixels.
    """
    wanted, found = _drawn(CPU, count, size), _drawn(device, count, size)
    rows: list[dict[str, Value]] = []
    for name, values in wanted.items():
        apart = ((found[name] - values).abs() / values.abs().max().clamp_min(1e-30)).numpy()
        shares = dict(zip(("half", "most", "bounded", "all"), _quantiles(apart), strict=True))
        bound = VALUES if name in PICTURE else GRADIENTS
        kept = "yes" if shares["bounded"] <= bound else "no"
        rows.append({"name": name, **shares, "bound": bound, "kept": kept})
    return rows


def _quantiles(apart: np.ndarray) -> list[float]:
    return [float(np.quantile(apart, share)) for share in (0.5, 0.99, 1 - RIMS, 1.0)]


def _drawn(device: torch.device, count: int, size: int) -> dict[str, Tensor]:
    """Pictures and gradients by name, on the CPU."""
    leaves = ball(count, device).map(lambda t: t.requires_grad_())
    views = [camera(size, size), camera(size, size).moved(np.diag([-1.0, 1, -1, 1]))]
    poses = torch.from_numpy(np.stack([v.world_to_camera for v in views])).requires_grad_()
    picture = render(leaves, views, world_to_camera=poses)
    weights = torch.from_numpy(np.random.default_rng(1).random(picture.rgb.shape)).float()
    ((picture.rgb * weights.to(device)).sum() + picture.depth.mean()).backward()
    values = {name: getattr(picture, name) for name in PICTURE}
    gradients = {f"gradient of {n}": v.grad for n, v in vars(leaves).items() if v is not None}
    found = values | gradients | {"gradient of poses": poses.grad}
    return {name: value.detach().cpu() for name, value in found.items() if value is not None}
