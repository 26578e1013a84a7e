"""Colours that look alike from everywhere, in the place of those that depend on the view.

Bundles and pages have spherical harmonics of degree 0 only. A Gaussian gets the mean of the colours
that cameras see, each camera counted by how much the Gaussian contributes to its picture.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ico3d.avatar.baking.samples import cameras_around
from ico3d.body.model_folder import TrainedBody
from ico3d.body.motion.window_model import HARMONICS, WindowModel
from ico3d.capture.capture import Capture
from ico3d.capture.pictures import train_cameras
from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.head.views import view_of
from ico3d.splat import harmonics
from ico3d.splat.density import contributions
from ico3d.splat.gaussians import Gaussians

PROBES = 32
"""Pictures from which it is learnt from where a head's Gaussians are seen."""
MOMENTS = (0.0, 0.5, 1.0)
"""Times τ of a window at which that is learnt of a body's Gaussians."""
RANGE = 0.001
"""Colours are kept this far within 0 and 1, where logits are finite."""


@torch.no_grad()
def mean_harmonics(drawn: Iterable[tuple[Gaussians, Camera]]) -> Tensor:
    """(N, K − 1) mean values of the harmonics above degree 0 in the directions that cameras see.

    Args:
        drawn: Pairs of the N Gaussians, with harmonics, and a camera that sees them. Gaussians that
            no camera sees have means of 0, as if they were seen from everywhere.
    """
    total: Tensor | None = None
    weight: Tensor | None = None
    for gaussians, camera in drawn:
        assert gaussians.sh is not None
        eye = torch.from_numpy(camera.camera_to_world[:3, 3]).to(gaussians.means)
        ways = torch.nn.functional.normalize(gaussians.means - eye, dim=-1)  # (N, 3)
        degree = harmonics.degree_of(gaussians.sh.shape[1])
        given = contributions(gaussians, [camera])[0][:, None]  # (N, 1)
        seen = given * harmonics.basis(ways, degree)[:, 1:]  # (N, K − 1)
        total = seen if total is None else total + seen
        weight = given if weight is None else weight + given
    assert total is not None and weight is not None
    return torch.where(weight > 0, total / weight.clamp_min(1e-12), 0)


def flat_colors(colors: Tensor, rest: Tensor, seen: Tensor) -> Tensor:
    """(N, 3) mean colours.

    Args:
        colors: (N, 3) colours of degree 0.
        rest: (N, K − 1, 3) coefficients of the harmonics above degree 0.
        seen: (N, K − 1) from `mean_harmonics`.
    """
    change = torch.einsum("nk,nkc->nc", seen.to(rest), rest)
    return (colors + change).clamp(RANGE, 1 - RANGE)


class FlatHead(HeadModel):
    """A head model with colours of degree 0; its values are the four logits of each Gaussian."""

    def __init__(self, model: HeadModel, seen: Tensor):
        """Takes a model with harmonics, whose parameters are copied, and `mean_harmonics`."""
        super().__init__(model.shape, len(model))
        self.load_state_dict(model.state_dict())
        self.to(model.device)
        self.seen: Tensor
        self.register_buffer("seen", seen.to(model.device), persistent=False)  # (N, K − 1)

    def logits(self, expression: Tensor, features: Tensor | None = None) -> Tensor:
        """(N, 4) logits of red, green, blue and opacity; arguments as for `HeadModel`."""
        values = super().logits(expression, features)  # (N, V)
        rest = values[:, 4:].unflatten(1, (-1, 3))  # (N, K − 1, 3)
        colors = flat_colors(values[:, :3].sigmoid(), rest, self.seen)
        return torch.cat([colors.logit(), values[:, 3:4]], 1)


def flat_head(
    head: TrainedHead, capture: Capture | None, expressions: Sequence[Tensor]
) -> TrainedHead:
    """A trained head with colours of degree 0; the head itself where it has no others.

    Args:
        head: The exact head.
        capture: Its recording, whose training frames tell from where Gaussians are seen; without
            it, cameras before and beside the face do.
        expressions: (B,) each, with which Gaussians are drawn for these cameras.
    """
    model = head.model
    if not model.shape.sh_degree:
        return head
    shown = [expressions[i] for i in spread(len(expressions), PROBES)]
    if capture is None:
        cameras = cameras_around(model, len(shown))
    else:
        frames = [f for f in capture.split.train if capture.world_from_head(f) is not None]
        frames = [frames[i] for i in spread(len(frames), PROBES)]
        count = len(capture.cameras)
        cameras = [view_of(capture, i % count, frame).camera for i, frame in enumerate(frames)]
    pairs = ((model(shown[i % len(shown)]), camera) for i, camera in enumerate(cameras))
    return replace(head, model=FlatHead(model, mean_harmonics(pairs)))


def depends_on_view(body: TrainedBody) -> bool:
    """Whether colours of a body depend on the direction of view."""
    return any(HARMONICS in model.gaussians for model in body.models)


def flat_body(body: TrainedBody, cameras: Sequence[Camera]) -> TrainedBody:
    """A trained body with colours of degree 0.

    Args:
        body: The exact body, whose colours depend on the view.
        cameras: Cameras in the world from which Gaussians are seen.
    """
    return replace(body, models=[_flat_window(model, cameras) for model in body.models])


def _flat_window(model: WindowModel, cameras: Sequence[Camera]) -> WindowModel:
    pairs = ((model.at(tau), camera) for tau in MOMENTS for camera in cameras)
    values = {name: value.detach() for name, value in model.gaussians.items()}
    rest = values.pop(HARMONICS)  # (N, K − 1, 3)
    colors = flat_colors(values["color_logits"].sigmoid(), rest, mean_harmonics(pairs))
    values["color_logits"] = colors.logit()
    return WindowModel(model.motion, values, model.shared, model.camera_colors)


def seeing_cameras(capture: Capture) -> list[Camera]:
    """The cameras of a recording that trained a body."""
    return [capture.cameras[index] for index in train_cameras(capture)]
