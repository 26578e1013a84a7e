"""Corrects head poses so that one rigid cloud of Gaussians explains all pictures.

Landmarks cover only the face; hair and ears lie far behind, where half a degree is visible. A
static cloud is fitted to the pictures together with a small correction of every pose, in the manner
of photometric tracking since Face2Face. L1 largely ignores the few percent of the head that speak
and blink.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from rich.console import Console
from torch import Tensor, nn

from ico3d.capture.portrait.settings import POSES, steps_for
from ico3d.capture.progress import Reached, tracked
from ico3d.common.camera import Camera
from ico3d.common.device import DeviceName
from ico3d.splat.device import computing_device
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.initial import resampled, spacing
from ico3d.splat.losses import photometric
from ico3d.splat.render import render

console = Console(stderr=True)

COUNT = 8_000
"""Number of Gaussians of the cloud."""
WARM_UP = 0.05
"""Share of the steps with fixed poses, because an untrained cloud cannot correct them."""
RATES = {"means": 1e-2, "quats": 2e-2, "log_scales": 3e-2, "colors": 5e-2, "opacities": 5e-2}
"""Learning rates; that of the means is also multiplied by half the size of the cloud."""
DECAYS = {"means": 0.01, "quats": 0.1, "log_scales": 0.1, "colors": 0.1, "opacities": 0.1}
"""Learning rates at the last step, as factors of those at the first."""
POSE_RATE, POSE_DECAY = 3e-3, 0.1
"""Learning rate of rotations in radians, and its factor at the last step.

Translations learn at the same rate times `METRES_PER_RADIAN`.
"""
METRES_PER_RADIAN = 1 / 6


@dataclass(frozen=True)
class Look:
    """A picture to be explained.

    Attributes:
        image: (H, W, 3) float32 in [0, 1].
        head: (H, W) float32 in [0, 1], 1 on the head; other pixels are ignored.
    """

    image: np.ndarray
    head: np.ndarray


@dataclass(frozen=True)
class Refined:
    """Corrected poses, and the size of the corrections.

    Attributes:
        poses: (F, 4, 4) corrected poses, camera from head.
        turn: Mean rotation of a correction, degrees.
        shift: Mean translation of a correction, metres.
    """

    poses: np.ndarray
    turn: float
    shift: float


class Cloud(nn.Module):
    """Static Gaussians, and one correction for each pose."""

    def __init__(self, points: np.ndarray, frames: int, rng: np.random.Generator):
        """Starts with grey, half transparent Gaussians and no corrections."""
        super().__init__()
        chosen = resampled(np.asarray(points, np.float64), COUNT, rng)  # (N, 3)
        size = torch.from_numpy(np.log(spacing(chosen))).float()
        self.means = nn.Parameter(torch.from_numpy(chosen).float())
        self.quats = nn.Parameter(torch.tensor([1.0, 0, 0, 0]).repeat(len(chosen), 1))
        self.log_scales = nn.Parameter(size[:, None].repeat(1, 3))  # (N, 3)
        self.colors = nn.Parameter(torch.zeros(len(chosen), 3))
        self.opacities = nn.Parameter(torch.full((len(chosen),), -2.0))
        self.corrections = nn.Embedding(frames, 6, sparse=True)
        nn.init.zeros_(self.corrections.weight)

    def forward(self, frame: int) -> Gaussians:
        """The cloud, moved by the corrected pose of a frame."""
        rigid = Gaussians(
            self.means,
            self.quats,
            self.log_scales.exp(),
            torch.sigmoid(self.opacities),
            torch.sigmoid(self.colors),
        )
        index = torch.tensor([frame], device=self.means.device)
        return rigid.transform(rigid_motion(self.corrections(index)[0]))


def rigid_motion(correction: Tensor) -> Tensor:
    """(4, 4) of a correction (6,): rotation vector in radians, translation in the same unit."""
    zero = torch.zeros_like(correction[0])
    x, y, z = correction[:3]
    skew = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).view(3, 3)
    shift = correction[3:, None] * METRES_PER_RADIAN  # (3, 1)
    top = torch.cat([torch.linalg.matrix_exp(skew), shift], 1)  # (3, 4)
    return torch.cat([top, top.new_tensor([[0.0, 0, 0, 1]])])


def refine_poses(
    poses: np.ndarray,
    points: np.ndarray,
    camera: Camera,
    background: np.ndarray,
    look: Callable[[int], Look],
    device: DeviceName = "auto",
    seed: int = 0,
    reached: Reached | None = None,
) -> Refined:
    """Corrects poses so that they agree with the pictures.

    Args:
        poses: (F, 4, 4) poses from landmarks, canonical head space to OpenCV camera axes.
        points: (P, 3) on the head, canonical head space, metres.
        camera: The camera of all pictures, at the origin of the space to which `poses` lead.
        background: (H, W, 3) clean plate of the camera.
        look: Returns the picture of a pose, given the pose's index.
        device: Where to compute.
        seed: Seed of the order of pictures and the choice of points.
        reached: Told about progress.

    Returns:
        Corrected poses in the same canonical space; the common part of all corrections is removed.
    """
    rng = np.random.default_rng(seed)
    place = computing_device(device)
    cloud = Cloud(points, len(poses), rng).to(place)
    behind = torch.from_numpy(background).to(place)
    steps = steps_for(len(poses))
    fit = _Fit(cloud, steps)
    order = np.concatenate([rng.permutation(len(poses)) for _ in range(-(-steps // len(poses)))])
    for step in tracked(range(steps), POSES, steps, console, reached):
        frame = int(order[step])
        seen = look(frame)
        image, head = (torch.from_numpy(part).to(place) for part in (seen.image, seen.head))
        picture = render(cloud(frame), [camera.moved(poses[frame])], behind).rgb[0]
        explained = image + head[..., None] * (picture - image)  # (H, W, 3)
        fit.update(photometric(explained[None], image[None]), step)
    return _refined(poses, cloud.corrections.weight.detach().cpu().double())


class _Fit:
    """Adam on cloud and corrections, with rates that decay."""

    def __init__(self, cloud: Cloud, steps: int):
        self._steps = steps
        extent = float(cloud.means.detach().amax(0).sub(cloud.means.detach().amin(0)).max() / 2)
        scaled = RATES | {"means": RATES["means"] * extent}
        groups = [{"params": [getattr(cloud, n)], "lr": r, "name": n} for n, r in scaled.items()]
        self._cloud = torch.optim.Adam(groups, eps=1e-15)
        # Each pose is visited rarely: moments that forget faster need no per-row correction.
        self._poses = torch.optim.SparseAdam(
            list(cloud.corrections.parameters()), lr=POSE_RATE, betas=(0.9, 0.99)
        )
        self._initial = [group["lr"] for group in self._cloud.param_groups]

    def update(self, loss: Tensor, step: int) -> None:
        """One step of the optimisation."""
        done = step / self._steps
        for group, rate in zip(self._cloud.param_groups, self._initial, strict=True):
            group["lr"] = rate * DECAYS[group["name"]] ** done
        for group in self._poses.param_groups:
            group["lr"] = POSE_RATE * POSE_DECAY**done if done > WARM_UP else 0.0
        for optimiser in (self._cloud, self._poses):
            optimiser.zero_grad()
        loss.backward()
        for optimiser in (self._cloud, self._poses):
            optimiser.step()


def _refined(poses: np.ndarray, corrections: Tensor) -> Refined:
    """Poses with their corrections, less what those have in common: the cloud may keep that."""
    common = np.linalg.inv(rigid_motion(corrections.mean(0)).numpy())
    moves = [rigid_motion(row).numpy() @ common for row in corrections]
    own = corrections - corrections.mean(0)
    return Refined(
        np.stack([pose @ move for pose, move in zip(poses, moves, strict=True)]),
        float(own[:, :3].norm(dim=1).rad2deg().mean()),
        float(own[:, 3:].norm(dim=1).mean()) * METRES_PER_RADIAN,
    )
