"""Evens out exposure and white balance that wander through a clip, as webcams' do.

A steady camera sees the same background all the time: what makes the surely visible part of it
brighter or more yellow in one picture than in the others is the camera, and is divided out of the
whole picture, in linear light. The face must agree, or nothing is done: it may be the background
that changes, a window or a screen.
"""

from pathlib import Path

import numpy as np

from ico3d.capture.portrait import cutout
from ico3d.capture.portrait.files import load_uint8, save_picture
from ico3d.capture.portrait.readings import Readings

LEAST_SPREAD = 0.02
"""Standard deviation of the logarithms of the factors below which pictures stay as they are."""
PIXELS = 4000
"""Number of pixels that are compared, at most."""
USABLE = (0.01, 0.8)
"""Linear light of the pixels that are compared: neither black nor nearly clipped."""
LEAST_PIXELS = 200


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
    background, faces = _seen(work, readings)
    if background is None:
        return 0.0
    factors = factors_of(background)  # (F, 3)
    spread = float(np.log(factors).std(0).max())
    if spread < LEAST_SPREAD or not agree(factors, faces):
        return 0.0
    for number, factor in zip(readings.frames, factors, strict=True):
        file = work / "ori_imgs" / f"{number}.jpg"
        save_picture(file, evened(load_uint8(file), factor))
    return spread


def factors_of(background: np.ndarray) -> np.ndarray:
    """(F, 3) factors of linear red, green and blue; the mean of their logarithms is 0.

    Args:
        background: (F, N, 3) linear light of N places of the background in F pictures.
    """
    usual = np.median(background, axis=0)  # (N, 3)
    usable = ((usual > USABLE[0]) & (usual < USABLE[1])).all(1)  # (N,)
    if usable.sum() < LEAST_PIXELS:
        return np.ones((len(background), 3))
    ratios = np.log(np.maximum(background[:, usable], 1e-4) / usual[usable])  # (F, n, 3)
    found = np.median(ratios, axis=1)  # (F, 3)
    return np.exp(found - found.mean(0))


def agree(factors: np.ndarray, faces: np.ndarray) -> bool:
    """Whether faces' mean linear light (F, 3) varies less once divided by factors (F, 3)."""
    light = np.log(np.maximum(faces, 1e-4))
    return bool((light - np.log(factors)).var(0).sum() < light.var(0).sum())


def evened(image: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """A picture (H, W, 3) uint8 whose linear red, green and blue are divided by factors (3,)."""
    light = linear(np.arange(256) / 255)[:, None] / factor  # (256, 3)
    table = (displayed(light) * 255 + 0.5).astype(np.uint8)
    return np.stack([table[image[..., c], c] for c in range(3)], -1)


def _seen(work: Path, readings: Readings) -> tuple[np.ndarray | None, np.ndarray]:
    """Linear light of background (F, N, 3), None where there is too little, and of faces (F, 3)."""
    import cv2

    first = load_uint8(work / "ori_imgs" / f"{readings.frames[0]}.jpg")
    shape = cutout.working(first).shape[:2]
    scale = shape[1] / first.shape[1]
    labels = [cutout.seeds(shape, marks * scale) for marks in readings.landmarks]
    behind = np.all([one == cv2.GC_BGD for one in labels], axis=0)  # (h, w)
    places = np.flatnonzero(behind)[:: max(1, behind.sum() // PIXELS)]
    background = np.empty((len(labels), len(places), 3), np.float32)
    faces = np.empty((len(labels), 3))
    for index, (number, marks) in enumerate(zip(readings.frames, readings.landmarks, strict=True)):
        small = cutout.working(load_uint8(work / "ori_imgs" / f"{number}.jpg"))
        light = linear(small / 255.0)
        background[index] = light.reshape(-1, 3)[places]
        faces[index] = light[cutout.inside_face(shape, marks * scale)].mean(0)
    return (background if len(places) >= LEAST_PIXELS else None), faces
