"""The head's colours under the light of the body's studio (paper, head–body integration).

Only the last layer of the head's network that makes colours is learnt: a hundred numbers or two,
so that a few small pictures of the face suffice and nothing of what drives the face is forgotten.
It happens once, before the windows are trained in parallel with the head as it then is.
"""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np
import torch
from rich.progress import track
from scipy.spatial import KDTree
from torch import Tensor, nn

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.face_views import FaceView
from ico3d.head.model import HeadModel
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render

CERTAIN = 0.5
"""Part of a pixel that the head and the person must fill, to count."""
NEIGHBOURS = 3
"""Of each Gaussian, that shall change alike."""
MEMORY = 2**30
"""Bytes for what is made once per frame."""
FLOATS = 14
"""Of a Gaussian."""


@dataclass(frozen=True)
class RecolourSettings:
    """How the colours are learnt.

    Attributes:
        steps: One picture each.
        rate: Learning rate of Adam; decays to a tenth.
        smoothness: Weight of how differently neighbours change: light changes all along a cheek,
            but what a few small pictures leave open must not become spots.
        seed: Decides the order of the pictures.
    """

    steps: int = 1500
    rate: float = 3e-2
    smoothness: float = 0.3
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
        views: What to agree with.
        settings: How.
    """
    layer, frozen = model.color_branch, _Frozen(model, placement, expressions)
    before, pairs = deepcopy(layer).requires_grad_(False), _neighbours(model)
    optimiser = torch.optim.Adam(layer.parameters(), settings.rate)
    decay = torch.optim.lr_scheduler.ExponentialLR(optimiser, 0.1 ** (1 / settings.steps))
    rng = np.random.default_rng(settings.seed)
    order = np.concatenate(
        [rng.permutation(len(views)) for _ in range(-(-settings.steps // len(views)))]
    )
    for index in track(order[: settings.steps], "matching colours", transient=True):
        optimiser.zero_grad()
        hidden, _ = frozen.at(views[index].frame)
        change = layer(hidden) - before(hidden)  # (N, 3)
        uneven = (change[pairs[:, 0]] - change[pairs[:, 1]]).square().mean()
        loss = _difference(layer, frozen, views[index]) + settings.smoothness * uneven
        loss.backward()
        optimiser.step()
        decay.step()
    optimiser.zero_grad()


def _neighbours(model: HeadModel) -> Tensor:
    """(P, 2) pairs of Gaussians that are next to one another."""
    means = model.means.detach().cpu().numpy()
    count = min(NEIGHBOURS + 1, len(means))
    _, nearest = KDTree(means).query(means, k=count)  # (N, K + 1), itself first
    others = np.asarray(nearest).reshape(len(means), count)[:, 1:]  # (N, K)
    first = np.repeat(np.arange(len(means)), count - 1)
    return torch.from_numpy(np.stack([first, others.ravel()], 1))


@torch.no_grad()
def color_difference(
    model: HeadModel, placement: Placement, expressions: np.ndarray, views: Sequence[FaceView]
) -> float:
    """Mean absolute difference of head and pictures where the head covers them."""
    frozen = _Frozen(model, placement, expressions)
    return float(np.mean([_difference(model.color_branch, frozen, view) for view in views]))


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
            drawn = self._model(values).transform(self._placement.world_from_head(frame))
            if len(self._made) >= self._room:
                self._made.pop(next(iter(self._made)))  # the oldest
            self._made[frame] = hidden, drawn.detach()
        return self._made[frame]


def _difference(layer: nn.Linear, frozen: _Frozen, view: FaceView) -> Tensor:
    """L1 over the pixels that head and person fill, but for mouth and eyes."""
    hidden, drawn = frozen.at(view.frame)
    rendering = render(replace(drawn, colors=layer(hidden).sigmoid()), [view.camera], view.image)
    weight = ((rendering.alpha[0] > CERTAIN) & (view.mask > CERTAIN)) * view.steady  # (H, W)
    difference = (rendering.rgb[0] - view.image).abs().mean(-1)  # (H, W)
    return (difference * weight).sum() / weight.sum().clamp_min(1)
