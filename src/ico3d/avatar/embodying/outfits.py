"""Outfits: other colours of jumper, trousers and shoes, whose stitches, folds and light stay."""

from dataclasses import replace

import numpy as np

from ico3d.avatar.embodying.drawn_colors import logits
from ico3d.avatar.embodying.garments import GARMENTS, garments_of
from ico3d.avatar.embodying.look import AS_RECORDED, OutfitName
from ico3d.avatar.embodying.surfaces import Surfaces
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.posing import posed, recorded_pose
from ico3d.errors import BundleError
from ico3d.motion.roles import Cast

OUTFITS: dict[OutfitName, tuple[tuple[float, float, float], ...]] = {
    "navy": ((0.08, 0.11, 0.21), (0.36, 0.32, 0.25), (0.20, 0.13, 0.09)),
    "wine": ((0.21, 0.05, 0.075), (0.12, 0.12, 0.13), (0.07, 0.06, 0.06)),
}
"""By outfit, the median display colours r, g, b of jumper, trousers and shoes in the body's light.
"""
LEAST = 40
"""Solid Gaussians that a garment has, where there is one."""


def dressed(body: BakedSkinned, cast: Cast, surfaces: Surfaces, outfit: OutfitName) -> BakedSkinned:
    """A body in another outfit.

    The logits of a garment's colours change by one amount for each channel, so lighter and darker
    places of it stay as far apart; skin and hair keep their colours.

    Args:
        body: The body as it was recorded.
        cast: Joints of its rig by role.
        surfaces: What of it is skin and hair.
        outfit: The outfit; `recorded` gives the same body.

    Raises:
        BundleError: If jumper, trousers or shoes are not found.
    """
    if outfit == AS_RECORDED:
        return body
    share = garments_of(body, cast, surfaces)  # (N, 3)
    shown = logits(posed(body, recorded_pose(body, 0)).rgb)  # (N, 3)
    change = np.zeros_like(shown)
    for part, color, name in zip(share.T, OUTFITS[outfit], GARMENTS, strict=True):
        own = (part > 0.9) & (body.opacities > 127)
        if own.sum() < LEAST:
            verb = "is" if name == "jumper" else "are"
            raise BundleError(
                f"no {name} {verb} found on the body, so it has no outfit but its own (recorded)."
            )
        change += part[:, None] * (logits(np.array(color)) - np.median(shown[own], axis=0))
    return replace(body, color_logits=(body.color_logits + change).astype(np.float16))
