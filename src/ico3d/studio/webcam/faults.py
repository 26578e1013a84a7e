"""What a webcam does wrong to pictures: pure functions, always the same for the same seed."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ico3d.errors import MissingExtraError

FaultName = Literal["noise", "exposure", "compression", "shutter", "drops"]
FAULTS: tuple[FaultName, ...] = get_args(FaultName)

ELECTRONS = 600.0
"""Electrons of a white pixel: the fewer, the more the light's own grain (shot noise) shows."""
READ_NOISE = 0.006
"""Standard deviation that reading the sensor adds, as a share of white in linear light."""
SWING, TINT = 0.3, 0.07
"""Standard deviations of exposure and of white balance, in stops (factors of two)."""
PERIODS = (2.5, 9.0)
"""Shortest and longest period of those swings, seconds."""
WAVES = 4
"""Number of waves that a swing is the sum of."""
READOUT = 0.7
"""Share of the time between two pictures that passes from reading the first row to the last."""
SLOW_FPS = 15.0
"""Pictures per second of a webcam that is short of light or of bandwidth."""
STRETCH = (2.0, 4.0)
"""Shortest and longest time, in seconds, that it stays slow, or as fast as it should be."""
REPEATED = 0.5
"""Share of the pictures that fail to come in whose place the last one is recorded again."""


def random_of(seed: int, fault: FaultName) -> np.random.Generator:
    """The source of a fault's random choices, which no other fault changes."""
    return np.random.default_rng([seed, 2, FAULTS.index(fault)])


def noisy(light: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Linear light (H, W, 3) with shot and read noise, which show most where it is dark."""
    sigma = np.sqrt(np.maximum(light, 0) / ELECTRONS + READ_NOISE**2)
    return light + sigma * random.standard_normal(light.shape)


def swings(frames: int, fps: float, random: np.random.Generator) -> np.ndarray:
    """(frames, 3) factors of linear red, green and blue under wandering exposure and white balance.

    The mean of their logarithms over the recording is 0, so that it is right on the whole.
    """
    exposure = SWING * _wandering(frames, fps, random)
    tint = TINT * _wandering(frames, fps, random)
    return 2.0 ** np.stack([exposure + tint, exposure, exposure - tint], 1)


def _wandering(frames: int, fps: float, random: np.random.Generator) -> np.ndarray:
    """(frames,) a smooth random course with mean 0 and standard deviation 1; 0 for one frame."""
    seconds = np.arange(frames)[:, None] / fps  # (F, 1)
    periods = random.uniform(*PERIODS, WAVES)
    course = np.sin(2 * np.pi * (seconds / periods + random.random(WAVES))).sum(1)  # (F,)
    course = course - course.mean()
    return course / max(course.std(), 1e-6)


def rolled(before: np.ndarray, now: np.ndarray, after: np.ndarray) -> np.ndarray:
    """A picture whose rows were read one after the other, the middle one at the picture's moment.

    Upper rows are moved back along the motion since the picture before, lower ones on along the
    motion to the picture after.

    Args:
        before: (H, W, 3) uint8 the picture before.
        now: (H, W, 3) uint8 the picture.
        after: (H, W, 3) uint8 the picture after.

    Returns:
        (H, W, 3) uint8.

    Raises:
        MissingExtraError: If OpenCV is not installed.
    """
    try:
        import cv2
    except ModuleNotFoundError:
        raise MissingExtraError(
            "opencv-contrib-python", "body", "a webcam's rolling shutter"
        ) from None

    height, width = now.shape[:2]
    late = READOUT * ((np.arange(height, dtype=np.float32) + 0.5) / height - 0.5)  # (H,)
    greys = [cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) for picture in (before, now, after)]
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    back = flow.calc(greys[1], greys[0], None)  # type: ignore (its stub wants a buffer)
    on = flow.calc(greys[1], greys[2], None)  # type: ignore
    moved = np.where(late[:, None, None] < 0, -back, on) * late[:, None, None]  # (H, W, 2)
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    x = (columns - moved[..., 0]).astype(np.float32)
    y = (rows - moved[..., 1]).astype(np.float32)
    return cv2.remap(now, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


@dataclass(frozen=True)
class Shown:
    """A picture of a film.

    Attributes:
        at: Number of the frame at whose time the film shows it.
        frame: Number of the frame that it shows.
    """

    at: int
    frame: int


def dropping(frames: int, fps: float, random: np.random.Generator) -> list[Shown]:
    """The pictures of a film by a webcam that is slow for some seconds, again and again.

    Where a picture did not come, the last one is shown once more, or there is a gap. The first
    always comes.
    """
    film, start, slow = [], 0, False
    while start < frames:
        end = min(frames, start + max(1, round(random.uniform(*STRETCH) * fps)))
        for at in range(start, end):
            came = not slow or _ticks(at - start, fps)
            if came:
                film.append(Shown(at, at))
            elif random.random() < REPEATED:
                film.append(Shown(at, film[-1].frame))
        start, slow = end, not slow
    return film


def _ticks(number: int, fps: float) -> bool:
    """Whether a slow webcam delivers a picture with this frame of a slow stretch."""
    share = min(1.0, SLOW_FPS / fps)
    return int(number * share) > int((number - 1) * share) or number == 0
