"""The head's colours under the light of the body's studio (paper, head–body integration).

Only the last layer of the head's network that makes colours is learnt: a hundred numbers or two,
so that a few small pictures of the face suffice and nothing of what drives the face is forgotten.
The change may tint everything at will, but differs little between neighbours, as light does. It
happens once, before the windows are trained in parallel with the head as it then is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
"""Part of a pixel that the head and the person must fill, to count."""
ROUGHNESS = 0.02
"""Weight of the squared difference of neighbours' light, in logits, beside the L1 of pictures."""
NEIGHBOURS, FRAMES = 6, 8
"""Of each Gaussian, in so many frames, that are compared."""
MEMORY = 2**30
"""Bytes for what is made once per frame."""
FLOATS = 14
"""Numbers that describe a Gaussian."""


@dataclass(frozen=True)
class RecolourSettings:
    """How the colours are learnt.

    Attributes:
        steps: Optimisation steps, one picture each.
        rate: Learning rate of Adam; decays to a tenth.
        seed: Decides the order of the pictures.
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
        model: Of the head, of a variant with a network; only its last colour layer changes.
        placement: Where the head is.
        expressions: (F, B) of the body's frames.
        views: Pictures of the body's recording, with which the head's colours shall agree.
        settings: Steps and learning rates.
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
    """Mean absolute difference of head and pictures where the head covers them."""
    frozen = _Frozen(model, placement, expressions)
    moved = (view.to(model.device) for view in views)
    return float(np.mean([float(_difference(model.color_branch, frozen, v)) for v in moved]))


class _Relit(nn.Module):
    """The colour layer (W, b) as (1 + M)·W + D, b + c: M and c tint, D is light from somewhere."""

    def __init__(self, layer: nn.Linear):
        super().__init__()
        self._weight, self._bias = layer.weight.detach().clone(), layer.bias.detach().clone()
        self.tint = nn.Parameter(self._weight.new_zeros(3, 3))
        self.local = nn.Parameter(torch.zeros_like(self._weight))  # (3, hidden)
        self.offset = nn.Parameter(self._weight.new_zeros(3))

    def forward(self, hidden: Tensor) -> Tensor:
        """(N, 3) logits of colours."""
        return nn.functional.linear(hidden, *self._values())

    @torch.no_grad()
    def write(self, layer: nn.Linear) -> None:
        """Makes it the layer's weights."""
        for parameter, value in zip((layer.weight, layer.bias), self._values(), strict=True):
            parameter.copy_(value)

    def _values(self) -> tuple[Tensor, Tensor]:
        return self._weight + self.tint @ self._weight + self.local, self._bias + self.offset


@torch.no_grad()
def _roughness(model: HeadModel, hidden: Sequence[Tensor]) -> Tensor:
    """(hidden, hidden) R: D·R·Dᵀ is how much D·h differs between neighbours, squared, per channel.

    Light changes slowly over a face. Without this, small pictures leave the layer free to paint
    blotches that only larger ones would show.

    Args:
        model: Where the Gaussians are.
        hidden: (N, hidden) what the layer takes in, by frame.
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
    """A few frames of views, evenly spread."""
    frames = sorted({view.frame for view in views})
    return [frames[index] for index in spread(len(frames), FRAMES)]


class _Frozen:
    """What of the head does not change: made once per frame, as far as that fits into memory."""

    def __init__(self, model: HeadModel, placement: Placement, expressions: np.ndarray):
        self._model, self._placement, self._expressions = model, placement, expressions
        self._made: dict[int, tuple[Tensor, Gaussians]] = {}
        floats = len(model) * (model.shape.hidden + FLOATS)
        self._room = max(MEMORY // (4 * floats), 1)

    @torch.no_grad()
    def at(self, frame: int) -> tuple[Tensor, Gaussians]:
        """What the layer takes in (N, hidden), and the head's Gaussians in the world."""
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
    """L1 over the pixels that head and person fill, but for mouth and eyes."""
    hidden, drawn = frozen.at(view.frame)
    rendering = render(replace(drawn, colors=layer(hidden).sigmoid()), [view.camera], view.image)
    weight = ((rendering.alpha[0] > CERTAIN) & (view.mask > CERTAIN)) * view.steady  # (H, W)
    difference = (rendering.rgb[0] - view.image).abs().mean(-1)  # (H, W)
    return (difference * weight).sum() / weight.sum().clamp_min(1)
