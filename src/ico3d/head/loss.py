"""The loss of head training (paper, head model: L1, SSIM and a perceptual term)."""

import logging
from collections.abc import Callable
from dataclasses import replace

import torch
from torch import Tensor

from ico3d.errors import MissingModelError, ModelError
from ico3d.head.settings import HeadSettings
from ico3d.head.views import Picture
from ico3d.splat.losses import photometric
from ico3d.splat.rendering import Rendering

log = logging.getLogger(__name__)


class HeadLoss:
    """λ_1·L1 + λ_s·(1 − SSIM) + λ_p·VGG, and terms on squared differences and on alpha.

    Attributes:
        settings: The settings; the perceptual term is off if VGG's weights are not installed.
    """

    def __init__(self, settings: HeadSettings, device: torch.device):
        """Loads VGG's weights if the perceptual term is wanted; logs a warning if there are none.

        Args:
            settings: Weights of the terms.
            device: Device of the pictures.
        """
        self._perceptual: Callable[[Tensor, Tensor], Tensor] | None = None
        if settings.loss.perceptual and settings.steps > settings.loss.perceptual_from:
            self._perceptual = _perceptual_term(device)
            if self._perceptual is None:
                settings = _without_perceptual(settings)
        self.settings = settings

    def go_on(self, perceptual_weight: float) -> None:
        """Sets the perceptual weight of a resumed run to the one that the run began with.

        Raises:
            ModelError: If the run used the perceptual term and VGG's weights are no longer
                installed.
        """
        if perceptual_weight and not self.settings.loss.perceptual:
            raise ModelError(
                "this run began with the perceptual term, and the weights of VGG are not there "
                "any more: put them back, or train into another folder."
            )
        if not perceptual_weight:
            self._perceptual = None
            self.settings = _without_perceptual(self.settings)

    def __call__(self, rendering: Rendering, target: Tensor, picture: Picture, step: int) -> Tensor:
        """The loss of one picture.

        Args:
            rendering: The rendered picture of one camera.
            target: (H, W, 3) picture to match, in [0, 1].
            picture: The recorded picture and masks from which the target was made.
            step: Number of the optimisation step.

        Returns:
            A scalar.
        """
        weights = self.settings.loss
        image = rendering.rgb  # (1, H, W, 3)
        if weights.torso != 1 and picture.torso is not None:
            ignored = ((1 - weights.torso) * picture.torso)[..., None]  # (H, W, 1)
            image = torch.lerp(image, target, ignored)  # (1, H, W, 3)
        loss = photometric(
            image,
            target[None],
            l1_weight=weights.l1,
            ssim_weight=weights.ssim,
            squares_weight=weights.squares,
        )
        if weights.alpha and picture.mask is not None:
            away = rendering.alpha[0] - picture.mask  # (H, W)
            if weights.torso == 0 and picture.torso is not None:
                away = away * (1 - picture.torso)  # nor does it matter whether anything is there
            loss = loss + weights.alpha * away.abs().mean()
        if self._perceptual is not None and step >= weights.perceptual_from:
            loss = loss + weights.perceptual * self._perceptual(image[0], target)
        return loss


def _without_perceptual(settings: HeadSettings) -> HeadSettings:
    return replace(settings, loss=replace(settings.loss, perceptual=0.0))


def _perceptual_term(device: torch.device) -> Callable[[Tensor, Tensor], Tensor] | None:
    """The VGG term, or None, with a warning, where its weights are not installed."""
    from ico3d.head.perceptual import PerceptualLoss

    try:
        return PerceptualLoss().to(device)
    except MissingModelError as error:
        log.warning("training goes on without the perceptual term, with weight 0: %s", error)
        return None
