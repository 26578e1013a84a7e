"""Evens out exposure and white balance that wander through a clip, as webcams' do.

A steady camera sees the same background all the time: what makes the surely visible part of it
brighter or more yellow in one picture than in the others is the camera, and is divided out of the
whole picture, in linear light. The face must agree, or nothing is done: it may be the background
that changes, a window or a screen.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ico3d.capture.portrait import cutout
from ico3d.capture.portrait.files import load_uint8, save_picture
from ico3d.capture.portrait.readings import Readings
from ico3d.common.spread import spread

LEAST_SPREAD = 0.02
"""Standard deviation of the logarithms of the factors below which pictures stay as they are."""
PIXELS = 4000
"""Number of pixels that are compared, at most."""
USABLE = (0.01, 0.8)
"""Linear light of the pixels that are compared: neither black nor nearly clipped."""
LEAST_PIXELS = 200
USUAL = 300
"""Number of pictures, spread over the clip, that tell how the background usually looks, at most:
all of a long clip would not fit into the memory."""


def linear(values: np.ndarray) -> np.ndarray:
    """Linear light of display values (sRGB), both in [0, 1] and of any shape."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def displayed(light: np.ndarray) -> np.ndarray:
    """Display values (sRGB) in [0, 1] of linear light of any shape; brighter light is clipped."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def even_out(work: Path, readings: Readings) -> float:
    """Divides wandering exposure and white balance out of the pictures, where there are any.

    Args:
        work: The capture, with a picture of each frame of `readings`.
        readings: Where the face is in them.

    Returns:
        How far they wandered, as a share of the light (standard deviation); 0 where nothing was
        done.
    """
    factors, faces = _seen(work, readings)
    wandered = float(np.log(factors).std(0).max())
    if wandered < LEAST_SPREAD or not agree(factors, faces):
        return 0.0
    for number, factor in zip(readings.frames, factors, strict=True):
        file = work / "ori_imgs" / f"{number}.jpg"
        save_picture(file, evened(load_uint8(file), factor))
    return wandered


def factors_of(background: Iterable[np.ndarray], usual: np.ndarray) -> np.ndarray:
    """(F, 3) factors of linear red, green and blue; the mean of their logarithms is 0.

    Args:
        background: (N, 3) linear light of N places of the background in each of F pictures.
        usual: (N, 3) how these places usually look.
    """
    usable = ((usual > USABLE[0]) & (usual < USABLE[1])).all(1)  # (N,)
    known = usable.sum() >= LEAST_PIXELS
    found = np.stack(
        [_shift(one[usable], usual[usable]) if known else np.zeros(3) for one in background]
    )
    return np.exp(found - found.mean(0))


def _shift(light: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """(3,) median logarithm of how much brighter places (n, 3) are than usually."""
    return np.median(np.log(np.maximum(light, 1e-4) / usual), axis=0)


def agree(factors: np.ndarray, faces: np.ndarray) -> bool:
    """Whether faces' mean linear light (F, 3) varies less once divided by factors (F, 3)."""
    light = np.log(np.maximum(faces, 1e-4))
    return bool((light - np.log(factors)).var(0).sum() < light.var(0).sum())


def evened(image: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """A picture (H, W, 3) uint8 whose linear red, green and blue are divided by factors (3,)."""
    light = linear(np.arange(256) / 255)[:, None] / factor  # (256, 3)
    table = (displayed(light) * 255 + 0.5).astype(np.uint8)
    return np.stack([table[image[..., c], c] for c in range(3)], -1)


def _seen(work: Path, readings: Readings) -> tuple[np.ndarray, np.ndarray]:
    """Factors (F, 3), 1 where too little is seen of the background, and faces' light (F, 3).

    One picture is in memory at a time, and of `USUAL` the places that are compared.
    """
    first = load_uint8(work / "ori_imgs" / f"{readings.frames[0]}.jpg")
    shape = cutout.working(first).shape[:2]
    scale = shape[1] / first.shape[1]
    places = _places(shape, [marks * scale for marks in readings.landmarks])
    chosen = [readings.frames[index] for index in spread(len(readings.frames), USUAL)]
    usual = np.median([_light(work, number)[places] for number in chosen], axis=0)  # (N, 3)
    faces: list[np.ndarray] = []

    def background() -> Iterable[np.ndarray]:
        for number, marks in zip(readings.frames, readings.landmarks, strict=True):
            light = _light(work, number)
            inside = cutout.inside_face(shape, marks * scale).reshape(-1)
            faces.append(light[inside].mean(0))
            yield light[places]

    return factors_of(background(), usual), np.array(faces)


def _places(shape: tuple[int, ...], landmarks: list[np.ndarray]) -> np.ndarray:
    """At most `PIXELS` indices of pixels that are background in every picture.

    Args:
        shape: (h, w) of the pictures.
        landmarks: (478, 2) of the face in pixels of each of them.
    """
    import cv2

    behind = np.ones(shape, bool)
    for marks in landmarks:
        behind &= cutout.seeds(shape, marks) == cv2.GC_BGD
    found = np.flatnonzero(behind)
    return found[:: max(1, -(-len(found) // PIXELS))]


def _light(work: Path, number: int) -> np.ndarray:
    """(h · w, 3) float32 linear light of a picture in working size."""
    small = cutout.working(load_uint8(work / "ori_imgs" / f"{number}.jpg"))
    return linear(small / 255.0).astype(np.float32).reshape(-1, 3)
