"""Parsing pictures of the talking-portrait layout: a colour for face, hair, neck and cloth."""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.face.landmarks import (
    CHIN,
    FACE_OVAL,
    FOREHEAD,
    INNER_LIPS,
    JAW,
    NOSE_BRIDGE,
    OUTER_LIPS,
    SIDES,
)

BACKGROUND = (255, 255, 255)
FACE = (0, 0, 255)
MOUTH = (100, 100, 100)
NECK = (0, 255, 0)
CLOTH = (255, 0, 0)
HAIR = (0, 0, 0)


def is_class(parsing: np.ndarray, *colours: tuple[int, int, int]) -> np.ndarray:
    """float32 (H, W): 1 where a parsing picture (H, W, 3) uint8 has one of the colours."""
    hits = [(parsing == np.array(colour, np.uint8)).all(-1) for colour in colours]
    return np.logical_or.reduce(hits).astype(np.float32)


@dataclass(frozen=True)
class PartColours:
    """Distribution of colours on each part of a person.

    Attributes:
        tables: Log density over coarse CIELAB cells, by the part's parsing colour.
    """

    tables: dict[tuple[int, int, int], np.ndarray]


CELLS = (16, 32, 32)
"""Number of cells of lightness, a and b."""


def learn_colours(
    images: list[np.ndarray], alphas: list[np.ndarray], landmarks: np.ndarray
) -> PartColours:
    """Learns the colours of hair, skin and cloth where the parts are unambiguous.

    Args:
        images: uint8 RGB (h, w, 3) pictures.
        alphas: (h, w) mask of the person in each picture.
        landmarks: (F, 478, 2) in pixels of the pictures.
    """
    from scipy.ndimage import gaussian_filter

    counts = {part: np.zeros(CELLS) for part in (HAIR, NECK, CLOTH)}
    for image, alpha, face in zip(images, alphas, landmarks, strict=True):
        cells = _cells(image)
        for part, place in _plain(alpha > 0.9, face).items():
            np.add.at(counts[part], tuple(cells[place].T), 1.0)
    smooth = {part: gaussian_filter(count, 1.0) for part, count in counts.items()}
    total = {part: max(float(count.sum()), 1.0) for part, count in smooth.items()}
    return PartColours({p: np.log(c / total[p] + 1e-7) for p, c in smooth.items()})


def _plain(person: np.ndarray, landmarks: np.ndarray) -> dict[tuple, np.ndarray]:
    """(h, w) bool per part: above the brows, on the cheeks, at the lower edge beside the neck."""
    tall, wide = face_size(landmarks)
    chin = landmarks[CHIN]
    rows = np.arange(person.shape[0])[:, None] + 0.5
    beside = np.abs(np.arange(person.shape[1]) + 0.5 - chin[0])[None] > 0.4 * wide
    face = filled(person.shape, landmarks[FACE_OVAL])
    cheeks = (
        face & (rows > landmarks[NOSE_BRIDGE, 1]) & ~filled(person.shape, landmarks[OUTER_LIPS])
    )
    return {
        HAIR: person & ~face & (rows < landmarks[FOREHEAD, 1] + 0.25 * tall),
        NECK: person & cheeks,
        CLOTH: person & beside & (rows > chin[1] + 0.15 * tall),
    }


def parse(
    image: np.ndarray, alpha: np.ndarray, landmarks: np.ndarray, colours: PartColours
) -> np.ndarray:
    """Labels the parts of a person by colour.

    Face and mouth come from the landmarks. Hair, neck and cloth are distinguished by colour and by
    their position relative to the jaw line, which is extended straight beside the face.

    Args:
        image: uint8 RGB (H, W, 3).
        alpha: (H, W) mask of the person.
        landmarks: (478, 2) pixels.
        colours: Colours that `learn_colours` returned.

    Returns:
        uint8 RGB (H, W, 3).
    """
    person = alpha > 0.5
    parts = (HAIR, NECK, CLOTH)
    likely = _place_likelihood(person.shape, landmarks)
    cells = tuple(np.moveaxis(_cells(image), -1, 0))
    scores = [_averaged(colours.tables[part][cells]) + likely[part] for part in parts]
    parsing = np.array(parts, np.uint8)[np.argmax(scores, axis=0)]
    parsing[~person] = BACKGROUND
    parsing[filled(person.shape, landmarks[FACE_OVAL]) & person] = FACE
    parsing[filled(person.shape, landmarks[INNER_LIPS])] = MOUTH
    return parsing


def _place_likelihood(shape: tuple[int, ...], landmarks: np.ndarray) -> dict[tuple, np.ndarray]:
    """(H, W) logarithm per part of how likely a place is on it."""
    tall, wide = face_size(landmarks)
    height, width = shape
    columns, rows = np.arange(width) + 0.5, np.arange(height)[:, None] + 0.5
    below = (rows - _jaw_line(columns, landmarks)) / tall  # faces under the jaw line
    aside = np.abs(columns - landmarks[CHIN, 0])[None] / wide
    hair = np.where(below > 0, -1.0 - 6 * below, 0.0)
    neck = (
        np.where(below < 0, -3.0, 1.0) - 8 * np.maximum(aside - 0.4, 0) - 2 * np.maximum(below, 0)
    )
    cloth = np.where(below < -0.3, -50.0, np.where(below < 0, -1.0, 0.0)) + 0 * aside
    return {HAIR: hair, NECK: neck, CLOTH: cloth}


def _averaged(scores: np.ndarray) -> np.ndarray:
    """Mean over a small neighbourhood, so that single pixels do not stand out."""
    import cv2

    side = max(3, scores.shape[0] // 64) | 1
    return cv2.blur(scores.astype(np.float32), (side, side))


def _cells(image: np.ndarray) -> np.ndarray:
    """(H, W, 3) cell of each pixel's colour."""
    import cv2

    lab = cv2.cvtColor(image, cv2.COLOR_RGB2LAB).astype(np.int64)
    return lab * np.array(CELLS) // 256


def face_size(landmarks: np.ndarray) -> tuple[float, float]:
    """Size of a face in pixels: forehead to chin, and side to side."""
    tall = np.linalg.norm(landmarks[CHIN] - landmarks[FOREHEAD])
    return float(tall), float(np.linalg.norm(landmarks[SIDES[1]] - landmarks[SIDES[0]]))


def filled(shape: tuple[int, ...], outline: np.ndarray) -> np.ndarray:
    """(H, W) bool: inside a polygon of pixels."""
    import cv2

    mask = np.zeros(shape, np.uint8)
    # OpenCV counts pixel centres as whole numbers; four fractional bits keep the rest.
    points = ((outline - 0.5) * 16).round().astype(np.int32)
    cv2.fillPoly(mask, [points], 1, shift=4)  # type: ignore
    return mask > 0


def _jaw_line(columns: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """(W,) height of the jaw in each column; not far above the chin, for hair hangs beside it."""
    jaw = landmarks[JAW][landmarks[JAW][:, 0].argsort()]
    tall, _ = face_size(landmarks)
    chin = landmarks[CHIN, 1]
    inner = np.interp(columns, jaw[:, 0], jaw[:, 1], left=0.0, right=0.0)
    return np.maximum(inner, chin - 0.1 * tall)
