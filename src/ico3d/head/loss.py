"""The loss of head training (paper, head model: L1, SSIM and a perceptual term)."""

import logging
from collections.abc import Callable

from torch import Tensor

from ico3d.errors import MissingModelError
from ico3d.head.settings import HeadSettings
from ico3d.head.views import Picture
from ico3d.splat.losses import l1, ssim
from ico3d.splat.rendering import Rendering

log = logging.getLogger(__name__)


class HeadLoss:
    """λ_1·L1 + λ_s·(1 − SSIM) + λ_p·VGG, and a term on alpha where masks exist."""

    def __init__(self, settings: HeadSettings):
        """Looks for VGG weights when the perceptual term is wanted; warns when there are none."""
        self._settings = settings
        self._perceptual: Callable[[Tensor, Tensor], Tensor] | None = None
        if settings.perceptual_weight and settings.steps > settings.perceptual_from:
            self._perceptual = _perceptual_term()

    def __call__(self, rendering: Rendering, target: Tensor, picture: Picture, step: int) -> Tensor:
        """The loss of one picture.

        Args:
            rendering: One camera's.
            target: (H, W, 3) in [0, 1].
            picture: What the target was made of.
            step: Number of the optimisation step.

        Returns:
            A scalar.
        """
        settings = self._settings
        image = rendering.rgb  # (1, H, W, 3)
        if settings.torso_weight != 1 and picture.torso is not None:
            ignored = ((1 - settings.torso_weight) * picture.torso)[..., None]  # (H, W, 1)
            image = image + ignored * (target - image)
        loss = settings.l1_weight * l1(image, target[None])
        loss = loss + settings.ssim_weight * (1 - ssim(image, target[None]))
        if settings.alpha_weight and picture.mask is not None:
            loss = loss + settings.alpha_weight * (rendering.alpha[0] - picture.mask).abs().mean()
        if self._perceptual is not None and step >= settings.perceptual_from:
            loss = loss + settings.perceptual_weight * self._perceptual(image[0], target)
        return loss


def _perceptual_term() -> Callable[[Tensor, Tensor], Tensor] | None:
    """The VGG term, or None, with a warning, where its weights are not installed."""
    from ico3d.head.perceptual import PerceptualLoss

    try:
        return PerceptualLoss()
    except MissingModelError as error:
        log.warning("training goes on without the perceptual term: %s", error)
        return None
