"""Blendshape names, and the seven eye and brow values from blendshapes or action units."""

from collections.abc import Mapping, Sequence

import numpy as np

from ico3d.capture.capture import EYE_NAMES
from ico3d.common.savitzky_golay import filtered

# fmt: off
BLENDSHAPES = (
    "_neutral", "browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft",
    "browOuterUpRight", "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "eyeBlinkLeft",
    "eyeBlinkRight", "eyeLookDownLeft", "eyeLookDownRight", "eyeLookInLeft", "eyeLookInRight",
    "eyeLookOutLeft", "eyeLookOutRight", "eyeLookUpLeft", "eyeLookUpRight", "eyeSquintLeft",
    "eyeSquintRight", "eyeWideLeft", "eyeWideRight", "jawForward", "jawLeft", "jawOpen",
    "jawRight", "mouthClose", "mouthDimpleLeft", "mouthDimpleRight", "mouthFrownLeft",
    "mouthFrownRight", "mouthFunnel", "mouthLeft", "mouthLowerDownLeft", "mouthLowerDownRight",
    "mouthPressLeft", "mouthPressRight", "mouthPucker", "mouthRight", "mouthRollLower",
    "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper", "mouthSmileLeft", "mouthSmileRight",
    "mouthStretchLeft", "mouthStretchRight", "mouthUpperUpLeft", "mouthUpperUpRight",
    "noseSneerLeft", "noseSneerRight",
)
# fmt: on
"""MediaPipe's 52 blendshapes in its order, which is that of `bs.npy` of talking-portrait tools."""

AU_COLUMNS = ("AU01_r", "AU02_r", "AU04_r", "AU45_r")
"""Columns of OpenFace's action-unit intensities (0 to 5) for eyes and brows."""


def eyes_of_blendshapes(blendshapes: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Smoothed eye values (N, 7) in the order of `EYE_NAMES`, from weights (N, len(names))."""
    return smoothed(blendshapes[:, [names.index(name) for name in EYE_NAMES]])


def eyes_of_action_units(units: Mapping[str, np.ndarray]) -> np.ndarray:
    """Smoothed eye values (N, 7) in the order of `EYE_NAMES`, from action units.

    Blink = clip(AU45, 0, 2) / 2. Brow lowerer (AU4), inner (AU1) and outer (AU2) brow raiser are
    divided by their range of 5. Action units do not distinguish left from right.
    """
    down, inner, outer = (np.clip(units[name] / 5, 0, 1) for name in ("AU04_r", "AU01_r", "AU02_r"))
    blink = np.clip(units["AU45_r"], 0, 2) / 2
    return smoothed(np.stack([down, down, inner, outer, outer, blink, blink], 1))


def smoothed(values: np.ndarray) -> np.ndarray:
    """Savitzky-Golay filter (5, 3) along the first axis, result limited to [0, 1]; float32."""
    calm = filtered(values, 5, 3) if len(values) >= 5 else values
    return np.clip(np.asarray(calm), 0, 1).astype(np.float32)
