"""Face parsing pictures of the talking-portrait layout: which pixel is face, hair, neck, cloth."""

import numpy as np

from ico3d.capture.multipie import CHIN, FACE_OVAL, FOREHEAD, INNER_LIPS

BACKGROUND = (255, 255, 255)
FACE = (0, 0, 255)
MOUTH = (100, 100, 100)
NECK = (0, 255, 0)
CLOTH = (255, 0, 0)
HAIR = (0, 0, 0)


def is_class(parsing: np.ndarray, *colours: tuple[int, int, int]) -> np.ndarray:
    """Where a parsing picture (H, W, 3) uint8 has one of the colours: float32 (H, W)."""
    hits = [(parsing == np.array(colour, np.uint8)).all(-1) for colour in colours]
    return np.logical_or.reduce(hits).astype(np.float32)


def parse(image: np.ndarray, alpha: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """Colours the parts of a person.

    Face and mouth come from the landmarks. What is left above the chin is hair; below it, neck
    is what has the colour of the face, the rest is cloth.

    Args:
        image: uint8 RGB (H, W, 3).
        alpha: (H, W) person.
        landmarks: (478, 2) pixels.

    Returns:
        uint8 RGB (H, W, 3).
    """
    person = alpha > 0.5
    parsing = np.full(image.shape, 255, np.uint8)
    face = _filled(person.shape, landmarks[FACE_OVAL])
    below = _below_jaw(person.shape, landmarks)
    skin = _skin(image, face, landmarks)
    parsing[person & ~below] = HAIR
    parsing[person & below] = CLOTH
    parsing[person & below & skin] = NECK
    parsing[face & person] = FACE
    parsing[_filled(person.shape, landmarks[INNER_LIPS])] = MOUTH
    return parsing


def _filled(shape: tuple[int, ...], outline: np.ndarray) -> np.ndarray:
    """(H, W) bool: inside a polygon of pixels, those whose centre is in it."""
    import cv2

    mask = np.zeros(shape, np.uint8)
    # OpenCV counts pixel centres as whole numbers; four fractional bits keep the rest.
    points = ((outline - 0.5) * 16).round().astype(np.int32)
    cv2.fillPoly(mask, [points], 1, shift=4)
    return mask > 0


def _below_jaw(shape: tuple[int, ...], landmarks: np.ndarray) -> np.ndarray:
    """(H, W) bool: under the jaw line, which is carried on straight beside the face."""
    height, width = shape
    jaw = landmarks[
        [132, 58, 172, 136, 150, 149, 176, 148, CHIN, 377, 400, 378, 379, 365, 397, 288, 361]
    ]
    order = jaw[:, 0].argsort()
    jaw = jaw[order]
    tall = np.linalg.norm(landmarks[CHIN] - landmarks[FOREHEAD])
    columns = np.arange(width) + 0.5
    inner = np.interp(columns, jaw[:, 0], jaw[:, 1])
    beside = (columns < jaw[0, 0]) | (columns > jaw[-1, 0])
    line = np.where(beside, landmarks[CHIN, 1] - 0.05 * tall, inner)
    return (np.arange(height)[:, None] + 0.5) > line[None]


def _skin(image: np.ndarray, face: np.ndarray, landmarks: np.ndarray) -> np.ndarray:
    """(H, W) bool: coloured like the face, and close under it."""
    import cv2

    lab = cv2.cvtColor(image, cv2.COLOR_RGB2LAB).astype(np.float32)
    samples = lab[face]
    middle = np.median(samples, axis=0)
    spread = np.maximum(1.5 * np.median(np.abs(samples - middle), axis=0), [14, 4, 5])
    away = (((lab - middle) / spread / np.array([3.0, 2.2, 2.2])) ** 2).sum(-1)
    return away < 1.0
