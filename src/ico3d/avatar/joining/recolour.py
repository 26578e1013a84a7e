"""Fits the head's colours to the light of the body's studio (paper, head–body integration).

Only the last colour layer of the head's network is learnt, a hundred numbers or two: a few small
pictures of the face suffice, and how expressions move the face is not forgotten. The change may
tint the whole head freely, but is kept alike between neighbouring Gaussians, as light is. It is
done once, before the body's windows are trained with this head.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from rich.progress import track
from scipy.spatial import KDTree
from torch import Tensor, nn

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.face_views import FaceView
from ico3d.common.spread import spread
from ico3d.head.model import HeadModel
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render
from ico3d.training.optimiser import Optimiser

CERTAIN = 0.5
"""Share of a pixel that both head and person must cover for the pixel to count."""
ROUGHNESS = 0.02
"""Weight of the squared change of light, in logits, between neighbours; pictures' L1 has 1."""
NEIGHBOURS, FRAMES = 6, 8
"""Number of neighbours of a Gaussian, and of frames, in which light is compared."""
MEMORY = 2**30
"""Bytes of the cache of what is computed once per frame."""
FLOATS = 14
"""Numbers of a Gaussian in that cache: mean, rotation, scale, opacity and colour."""


@dataclass(frozen=True)
class RecolourSettings:
    """How the colours are learnt.

    Attributes:
        steps: Optimisation steps, with one picture each.
        rate: Learning rate of Adam, which decays to a tenth.
        seed: Seed of the order of the pictures.
    """

    steps: int = 800
    rate: float = 3e-2
    seed: int = 0


def recolour(
    model: HeadModel,
    placement: Placement,
    expressions: np.ndarray,
    views: Sequence[FaceView],
    settings: RecolourSettings,
) -> None:
    """Fits the head's colours to pictures of the body's capture, in place.

    Args:
        model: The head, of a variant with a network; only its last colour layer changes.
        placement: Where the head is in each frame.
        expressions: (F, B) expression in each frame of the body's recording.
        views: Pictures of the face in the body's recording.
        settings: Steps and learning rate.
    """
    frozen = _Frozen(model, placement, expressions)
    layer = _Relit(model.color_branch)
    views = [view.to(model.device) for view in views]
    roughness = _roughness(model, [frozen.at(frame)[0] for frame in _some(views)])
    optimiser, learnt = Optimiser(), dict(layer.named_parameters())
    rng = np.random.default_rng(settings.seed)
    order = np.concatenate(
        [rng.permutation(len(views)) for _ in range(-(-settings.steps // len(views)))]
    )
    shown = track(order[: settings.steps], "matching colours", transient=True)
    for step, index in enumerate(shown):
        penalty = ROUGHNESS * (layer.local @ roughness * layer.local).sum()
        loss = _difference(layer, frozen, views[index]) + penalty
        rate = settings.rate * 0.1 ** (step / settings.steps)
        gradients = torch.autograd.grad(loss, list(learnt.values()))
        for (name, value), gradient in zip(learnt.items(), gradients, strict=True):
            optimiser.update(name, value, gradient, rate)
    layer.write(model.color_branch)


@torch.no_grad()
def color_difference(
    model: HeadModel, placement: Placement, expressions: np.ndarray, views: Sequence[FaceView]
) -> float:
    """Mean absolute RGB difference, in [0, 1], between head and pictures where both show the head.

    Args:
        model: The head, of a variant with a network.
        placement: Where the head is in each frame.
        expressions: (F, B) expression in each frame of the body's recording.
        views: Pictures of the face in the body's recording.
    """
    frozen = _Frozen(model, placement, expressions)
    moved = (view.to(model.device) for view in views)
    return float(np.mean([float(_difference(model.color_branch, frozen, v)) for v in moved]))


class _Relit(nn.Module):
    """A colour layer (W, b) changed to ((1 + M)·W + D, b + c).

    M (`tint`) and c (`offset`) tint all Gaussians alike; D (`local`) varies between Gaussians, as
    light from one side does.
    """

    def __init__(self, layer: nn.Linear):
        super().__init__()
        self._weight, self._bias = layer.weight.detach().clone(), layer.bias.detach().clone()
        self.tint = nn.Parameter(self._weight.new_zeros(3, 3))
        self.local = nn.Parameter(torch.zeros_like(self._weight))  # (3, hidden)
        self.offset = nn.Parameter(self._weight.new_zeros(3))

    def forward(self, hidden: Tensor) -> Tensor:
        """(N, 3) logits of colours from the layer's inputs (N, hidden)."""
        return nn.functional.linear(hidden, *self._values())

    @torch.no_grad()
    def write(self, layer: nn.Linear) -> None:
        """Copies the changed weights into a layer."""
        for parameter, value in zip((layer.weight, layer.bias), self._values(), strict=True):
            parameter.copy_(value)

    def _values(self) -> tuple[Tensor, Tensor]:
        return self._weight + self.tint @ self._weight + self.local, self._bias + self.offset


@torch.no_grad()
def _roughness(model: HeadModel, hidden: Sequence[Tensor]) -> Tensor:
    """A matrix that measures how much a change of the colour layer differs between neighbours.

    Light changes slowly over a face. Without this penalty the layer could paint blotches that are
    too small to be seen in small pictures.

    Args:
        model: The head, for the positions of its Gaussians.
        hidden: (N, hidden) inputs of the layer in each of some frames.

    Returns:
        (hidden, hidden) R: the diagonal of D·R·Dᵀ is the mean squared difference of D·h between
        neighbouring Gaussians, in each colour channel.
    """
    means = model.means.detach().cpu().numpy()
    _, nearest = KDTree(means).query(means, k=min(1 + NEIGHBOURS, len(means)))  # (N, 1 + K)
    others = torch.from_numpy(np.asarray(nearest)[:, 1:]).to(model.device)  # (N, K)
    total = hidden[0].new_zeros(hidden[0].shape[1], hidden[0].shape[1])
    for values in hidden:
        for neighbour in others.T:
            step = values - values[neighbour]  # (N, hidden)
            total += step.T @ step / (len(step) * others.shape[1] * len(hidden))
    return total


def _some(views: Sequence[FaceView]) -> list[int]:
    """Up to `FRAMES` frames of the views, evenly spread."""
    frames = sorted({view.frame for view in views})
    return [frames[index] for index in spread(len(frames), FRAMES)]


class _Frozen:
    """Caches, for each frame, what of the head does not change while colours are learnt."""

    def __init__(self, model: HeadModel, placement: Placement, expressions: np.ndarray):
        self._model, self._placement, self._expressions = model, placement, expressions
        self._made: dict[int, tuple[Tensor, Gaussians]] = {}
        floats = len(model) * (model.shape.hidden + FLOATS)
        self._room = max(MEMORY // (4 * floats), 1)

    @torch.no_grad()
    def at(self, frame: int) -> tuple[Tensor, Gaussians]:
        """Inputs (N, hidden) of the colour layer, and the head's Gaussians in the world."""
        if frame not in self._made:
            values = torch.from_numpy(self._expressions[frame])  # (B,)
            hidden = self._model.hidden(self._model.blended(values), values)  # (N, hidden)
            head = self._model.gaussians(self._model.branches(hidden))
            drawn = head.transform(self._placement.world_from_head(frame))
            if len(self._made) >= self._room:
                self._made.pop(next(iter(self._made)))  # the oldest
            self._made[frame] = hidden, drawn.detach()
        return self._made[frame]


def _difference(layer: nn.Module, frozen: _Frozen, view: FaceView) -> Tensor:
    """Mean absolute difference over pixels that head and person cover, but for mouth and eyes."""
    hidden, drawn = frozen.at(view.frame)
    rendering = render(drawn.painted(layer(hidden).sigmoid()), [view.camera], view.image)
    weight = ((rendering.alpha[0] > CERTAIN) & (view.mask > CERTAIN)) * view.steady  # (H, W)
    difference = (rendering.rgb[0] - view.image).abs().mean(-1)  # (H, W)
    return (difference * weight).sum() / weight.sum().clamp_min(1)
