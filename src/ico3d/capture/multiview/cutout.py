"""Cuts out a person by comparing a picture with the clean plate."""

import numpy as np

from ico3d.capture.extras import opencv
from ico3d.errors import CaptureError

PURPOSE = "cutting people out of their background"
SURE, MAYBE = 34.0, 13.0
"""Differences of colour, of 255, that some part of a person must have, and that others may have."""
DARKEST_SHADOW = 0.72
"""Least factor by which an even darkening of the plate still counts as a shadow."""
EVEN = 0.03
"""Largest variation of a shadow's darkening factor within a few pixels."""
GAIN = 1.25
"""Largest factor of exposure between plate and picture."""
RIM = 1 / 250
"""Width of the rim that is compared with a part's inside, as a share of the picture's height."""
SHARP = 0.5
"""At the outline of a shadow, the difference rises by less than this share of its inner value."""
SMALLEST_PART = 0.004
"""Size below which parts are noise, as a share of the largest part."""
LARGEST_HOLE = 0.01
"""Size below which holes are filled, as a share of the person: clothes can match the plate."""
EDGE = 1 / 500
"""Half the width of the soft edge, as a share of the picture's height."""


def matte(picture: np.ndarray, plate: np.ndarray) -> np.ndarray:
    """Cuts out what differs from the clean plate.

    The exposures are matched. Differences that neighbouring pixels of the plate explain are noise
    or camera shake; even darkening is a shadow. Everything that differs clearly, together with
    adjacent parts that differ slightly, is the person. Along the edge, opacity follows from where
    the colour lies between plate and person.

    Args:
        picture: uint8 RGB (H, W, 3).
        plate: uint8 RGB (H, W, 3) of the same camera without the person.

    Returns:
        uint8 (H, W), 255 on the person.

    Raises:
        CaptureError: If the shapes differ.
        MissingExtraError: If OpenCV is not installed.
    """
    if picture.shape != plate.shape:
        raise CaptureError(f"the picture is {picture.shape}, its background {plate.shape}.")
    cv2 = opencv(PURPOSE)
    calm = [cv2.GaussianBlur(image, (3, 3), 0).astype(np.float32) for image in (picture, plate)]
    behind = calm[1] * exposure(*calm)
    difference = unexplained(calm[0], behind)
    inside = solid(difference > SURE, difference > MAYBE)
    return soft_edge(picture.astype(np.float32), behind, inside)


def exposure(picture: np.ndarray, plate: np.ndarray) -> np.ndarray:
    """(3,) factors from the plate's to the picture's brightness, median over background pixels."""
    few = (slice(None, None, 4), slice(None, None, 4))
    ratio = (picture[few] + 1) / (plate[few] + 1)
    bright = plate[few].min(-1) > 24
    near = (np.abs(np.log(ratio)) < np.log(GAIN)).all(-1) & bright
    # Where a person hides nearly all of the plate, likely pixels are chance.
    if near.sum() < max(16, 0.05 * near.size):
        return np.ones(3, np.float32)
    return np.median(ratio[near], 0).astype(np.float32)


def unexplained(picture: np.ndarray, plate: np.ndarray) -> np.ndarray:
    """(H, W) difference of colour that neither nearby plate pixels nor shadows explain."""
    cv2 = opencv(PURPOSE)
    near = np.ones((3, 3), np.uint8)
    low, high = cv2.erode(plate, near), cv2.dilate(plate, near)
    plain = np.maximum(np.maximum(low - picture, picture - high), 0).max(-1)
    # Darkened plate (Horprasert et al. 1999): the factor that fits best, and what it leaves.
    factor = (picture * plate).sum(-1) / np.maximum((plate * plate).sum(-1), 1)
    left = np.abs(picture - factor[..., None] * plate).max(-1)
    dark = (factor > DARKEST_SHADOW) & (factor < 1) & (left < MAYBE)
    dark &= _spread(factor, dark) < EVEN
    return np.where(soft_parts(plain, dark & (plain > MAYBE)), left, plain)


def _spread(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(H, W) standard deviation among the pixels near each one that a mask holds."""
    cv2 = opencv(PURPOSE)
    weight = where.astype(np.float32)
    count = np.maximum(cv2.blur(weight, (7, 7)), 1e-6)
    mean, square = (cv2.blur(weight * values**power, (7, 7)) / count for power in (1, 2))
    return np.sqrt(np.maximum(square - mean**2, 0))


def soft_parts(difference: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Connected parts of a mask that fade in over many pixels, as shadows do.

    Grey clothes before a grey wall differ from the wall like a shadow, but their outline is sharp:
    the difference has its full value right at the edge.

    Args:
        difference: (H, W) difference from the plate.
        parts: (H, W) bool mask.

    Returns:
        (H, W) bool, the soft parts.
    """
    cv2 = opencv(PURPOSE)
    near = np.ones((3, 3), np.uint8)
    closed = cv2.morphologyEx(parts.astype(np.uint8), cv2.MORPH_CLOSE, near)
    count, labels = cv2.connectedComponents(closed)
    width = 2 * max(2, round(RIM * parts.shape[0])) + 1
    inside = cv2.erode(closed, np.ones((width, width), np.uint8)) > 0
    around = cv2.dilate(labels.astype(np.float32), np.ones((width, width), np.uint8)).astype(int)
    around[(closed > 0) | (difference > MAYBE)] = 0
    rim = np.where(inside, 0, labels)
    step = _means(difference, rim, count) - _means(difference, around, count)
    soft = step < SHARP * _means(difference, np.where(inside, labels, 0), count)
    soft[0] = False
    return soft[labels] & parts


def _means(values: np.ndarray, labels: np.ndarray, count: int) -> np.ndarray:
    """(count,) mean of the values under each label."""
    sums = np.bincount(labels.ravel(), values.ravel(), count)
    return sums / np.maximum(np.bincount(labels.ravel(), minlength=count), 1)


def solid(sure: np.ndarray, maybe: np.ndarray) -> np.ndarray:
    """(H, W) bool: connected parts of `maybe` that contain `sure` pixels, without specks and holes.

    Args:
        sure: (H, W) bool, pixels that certainly show the person.
        maybe: (H, W) bool, pixels that may show the person.
    """
    cv2 = opencv(PURPOSE)
    near = np.ones((3, 3), np.uint8)
    closed = cv2.morphologyEx(maybe.astype(np.uint8), cv2.MORPH_CLOSE, near)
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, near)
    count, parts, stats, _ = cv2.connectedComponentsWithStats(opened)
    areas = stats[:, cv2.CC_STAT_AREA]
    kept = np.zeros(count, bool)
    kept[np.unique(parts[sure & (opened > 0)])] = True
    kept[0] = False
    kept &= areas >= SMALLEST_PART * np.max(areas, where=kept, initial=0)
    inside = kept[parts]
    _, holes, sizes, _ = cv2.connectedComponentsWithStats(
        (~inside).astype(np.uint8), connectivity=4
    )
    small = sizes[:, cv2.CC_STAT_AREA] < LARGEST_HOLE * inside.sum()
    small[0] = False
    return inside | small[holes]


def soft_edge(picture: np.ndarray, plate: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """uint8 (H, W) opacity, soft along the outline by comparing colours of person and plate.

    Args:
        picture: float32 (H, W, 3) picture.
        plate: float32 (H, W, 3) clean plate, matched to the picture's exposure.
        inside: (H, W) bool, the person.
    """
    cv2 = opencv(PURPOSE)
    half = max(2, round(EDGE * inside.shape[0]))
    near = np.ones((2 * half + 1, 2 * half + 1), np.uint8)
    core = cv2.erode(inside.astype(np.uint8), near)
    band = (cv2.dilate(inside.astype(np.uint8), near) > 0) & (core == 0)
    reach = (4 * half + 3, 4 * half + 3)
    weight = cv2.blur(core.astype(np.float32), reach)
    person = cv2.blur(picture * core[..., None], reach) / np.maximum(weight, 1e-6)[..., None]
    way = person - plate
    length = (way * way).sum(-1)
    along = ((picture - plate) * way).sum(-1) / np.maximum(length, 1)
    # Where person and plate look alike, or the person is thinner than the band, the outline holds.
    known = (weight > 1e-3) & (length > MAYBE**2)
    alpha = np.where(known, np.clip(along, 0, 1), inside.astype(np.float32))
    return np.rint(255 * np.where(band, alpha, inside)).astype(np.uint8)
