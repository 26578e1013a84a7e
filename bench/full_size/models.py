"""Random Gaussians, heads and bodies of any size, to be drawn and timed."""

from dataclasses import asdict

import numpy as np
import torch

from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.body.settings import PRESETS as BODIES
from ico3d.body.training.prepare_window import deformation
from ico3d.common.camera import Camera, look_at
from ico3d.head.model import HeadModel, HeadShape
from ico3d.head.settings import PRESETS as HEADS
from ico3d.splat.gaussians import Gaussians

SPEECH = 39
"""Length of the expression of a head that speech drives."""
FRAMES = 16
"""Frames of a body's window, and so the times of its encoder."""


def camera(width: int, height: int) -> Camera:
    """Looks at the origin from 1.5 m away."""
    focal = 1.2 * height
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(width, height, intrinsics, look_at((0.0, 0.0, 1.5), (0.0, 0.0, 0.0)))


def ball(count: int, device: torch.device, radius: float = 0.5, seed: int = 0) -> Gaussians:
    """Gaussians as small as those of a trained person, in a ball around the origin."""
    rng = np.random.default_rng(seed)
    means = rng.normal(size=(count, 3))
    means *= radius * rng.random((count, 1)) ** (1 / 3) / np.linalg.norm(means, axis=1)[:, None]
    values = (
        means,
        rng.normal(size=(count, 4)),
        np.exp(rng.uniform(np.log(0.002), np.log(0.012), (count, 3))),
        rng.uniform(0.05, 0.95, count),
        rng.random((count, 3)),
    )
    return Gaussians(*(torch.from_numpy(v).float().to(device) for v in values))


def backdrop(count: int, device: torch.device) -> Gaussians:
    """Gaussians of a wall 2 m behind the origin, each as large as a hand."""
    behind = ball(count, device, seed=1)
    spread = torch.tensor([8.0, 6.0, 0.2], device=device)
    away = torch.tensor([0.0, 0.0, -2.0], device=device)
    return Gaussians(
        behind.means * spread + away,
        behind.quats,
        8 * behind.scales,
        behind.opacities,
        behind.colors,
    )


def random_head(count: int, device: torch.device) -> HeadModel:
    """A head of the paper's network, driven by speech."""
    torch.manual_seed(0)
    network = HEADS["paper"].network
    shape = HeadShape(SPEECH, **asdict(network))
    model, start = HeadModel(shape, count), ball(count, torch.device("cpu"), 0.12)
    model.means.data = start.means
    model.log_scales.data = start.scales.log()
    model.basis.data.normal_()
    return model.to(device)


def random_body(count: int, device: torch.device) -> WindowModel:
    """A window of SWinGS++ with the paper's encoder and network."""
    start, random = ball(count, torch.device("cpu"), seed=2), torch.Generator().manual_seed(0)
    means = start.means * torch.tensor([0.5, 1.7, 0.4])  # (N, 3)
    settings = BODIES["paper"]
    motion = deformation("swings++", settings, Window(0, FRAMES - 1), means.numpy())
    gaussians = {
        "means": means,
        "quats": start.quats,
        "log_scales": start.scales.log(),
        "opacity_logits": start.opacities.logit(),
        "color_logits": torch.rand(count, 3, generator=random).clamp(0.01, 0.99).logit(),
    }
    if motion.per_gaussian:
        gaussians["alpha"] = torch.full((count, settings.mlp.sets), 1 / settings.mlp.sets)
    model = WindowModel(motion, gaussians, motion.initial(random))
    model.to(device)
    return model
