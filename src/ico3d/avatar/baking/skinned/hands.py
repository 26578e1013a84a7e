"""Hands in poses that nobody recorded.

Between gestures hands hang, palms to the thighs and fingers curled: most of a palm is learnt in its
own shade, which nothing tells from its colour. Raised to wave, it looks dirty. So the shade is
taken out of hands, for what is darker than most of the hand's skin, and in patches: rings, nails
and creases stay. Measured in docs/choices.md, "Bodies on a skeleton".
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from ico3d.bundle.skinned.baked import WEIGHT_UNIT, BakedSkinned
from ico3d.errors import SettingsError
from ico3d.motion.roles import Cast, cast

LIT = 0.65
"""Quantile of a hand's brightness, in mean logits of r, g, b, that counts as skin in light.

It is one of areas, as fingers have the most Gaussians by number.
"""
AROUND = 0.005
"""Radius in metres in which brightness is shade; what is smaller than that is detail."""
KEPT = 0.4
"""Share of the residual shapes' colours that hands keep: they know recorded poses alone."""
PALM = 0.3
"""How far beyond the wrist the palm begins, in lengths from wrist to middle finger."""
LEAST = 20
"""Fewest Gaussians of a hand that is evened."""


def evened(baked: BakedSkinned) -> BakedSkinned:
    """The body with hands whose shade is taken out; as it is where the rig has no fingers."""
    try:
        roles = cast(baked.rig)
    except SettingsError:
        return baked
    logits = baked.color_logits.astype(np.float32)  # (N, 3)
    scales = baked.shape_scales.astype(np.float32)  # (N, 2)
    for side in ("left", "right"):
        if not roles.has_fingers(side):
            continue
        share = _share_of_hand(baked, roles, side)  # (N,)
        skin = np.flatnonzero(share > 0.5)
        if len(skin) < LEAST:
            continue
        bright = logits[skin].mean(1)
        lit = _quantile(bright, _areas(baked, skin))
        shade = np.maximum(lit - _around(baked, skin, bright), 0)
        logits[skin] += (shade * share[skin])[:, None]
        scales[:, 1] *= 1 - (1 - KEPT) * share
    return replace(
        baked,
        color_logits=logits.astype(np.float16),
        shape_scales=scales.astype(np.float16),
    )


def _share_of_hand(baked: BakedSkinned, roles: Cast, side: str) -> np.ndarray:
    """(N,) how much of each Gaussian moves with palm and fingers, in [0, 1]."""
    wrist, middle = roles.place(f"{side}_wrist"), roles.place(f"{side}_middle1")
    along = middle - wrist
    beyond = (baked.means - wrist) @ along > PALM * (along @ along)  # (N,)
    hand = roles.below(f"{side}_wrist")[baked.joints]  # (N, 4)
    carried = hand * (baked.weights / np.float32(WEIGHT_UNIT))  # (N, 4)
    return carried.sum(1) * beyond


def _areas(baked: BakedSkinned, some: np.ndarray) -> np.ndarray:
    """(M,) areas that M Gaussians cover, by their two longer axes and their opacity."""
    log_scales = np.sort(baked.log_scales[some].astype(np.float64), axis=1)  # (M, 3)
    return np.exp(log_scales[:, 1:].sum(axis=1)) * baked.opacities[some]


def _quantile(values: np.ndarray, weights: np.ndarray) -> float:
    """The value up to which `LIT` of the weight lies, of (M,) values."""
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(below, LIT * below[-1])])


def _around(baked: BakedSkinned, skin: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """(M,) mean brightness about each of M Gaussians, the opaque ones counting most."""
    opacities = baked.opacities[skin] / 255 + 1e-3
    near = KDTree(baked.means[skin]).query_ball_point(baked.means[skin], AROUND)
    return np.array([np.average(bright[some], weights=opacities[some]) for some in near])
