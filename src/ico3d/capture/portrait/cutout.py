"""Separates person and background in a portrait clip with a fixed camera.

No segmentation network is used. Colours of person and background are learnt on a few frames
(GrabCut, seeded by the face); background that is visible in any frame becomes a clean plate; every
frame is then cut by colour, plate and face together.
"""

from dataclasses import dataclass

import numpy as np

from ico3d.capture.face.landmarks import CHIN, FACE_OVAL, FOREHEAD, SIDES

WORK_SIZE = 256
"""Short side in pixels at which pictures are cut; edges are then refined at full resolution."""


@dataclass(frozen=True)
class Models:
    """Colours of person and background, and the clean plate.

    Attributes:
        person: (1, 65) OpenCV's Gaussian mixture of the person.
        background: (1, 65) OpenCV's Gaussian mixture of the background.
        plate: (h, w, 3) uint8 clean plate in working size.
        known: (h, w) bool, where background was visible.
    """

    person: np.ndarray
    background: np.ndarray
    plate: np.ndarray
    known: np.ndarray


def working(image: np.ndarray) -> np.ndarray:
    """The picture, scaled down to working size."""
    import cv2

    scale = min(1.0, WORK_SIZE / min(image.shape[:2]))
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def seeds(shape: tuple[int, ...], landmarks: np.ndarray) -> np.ndarray:
    """Initial labels of person and background, derived from the face.

    Args:
        shape: (h, w, …) shape of the picture.
        landmarks: (478, 2) in pixels of the picture.

    Returns:
        (h, w) uint8 labels of OpenCV's GrabCut.
    """
    import cv2

    height, width = shape[:2]
    chin, brow = landmarks[CHIN], landmarks[FOREHEAD]
    wide = float(np.linalg.norm(landmarks[SIDES[1]] - landmarks[SIDES[0]]))
    tall = float(np.linalg.norm(chin - brow))
    middle = (landmarks[SIDES[0]] + landmarks[SIDES[1]]) / 2
    labels = np.full((height, width), cv2.GC_BGD, np.uint8)
    crown = tuple((middle - [0, 0.25 * tall]).round().astype(int).tolist())
    axes = (round(1.05 * wide), round(1.25 * tall))
    cv2.ellipse(labels, crown, axes, 0, 0, 360, cv2.GC_PR_BGD, -1)
    shoulders = round(chin[1] - 0.3 * tall)
    labels[max(shoulders, 0) :] = cv2.GC_PR_BGD
    hair = tuple((middle - [0, 0.15 * tall]).round().astype(int).tolist())
    cv2.ellipse(labels, hair, (round(0.7 * wide), round(0.85 * tall)), 0, 0, 360, cv2.GC_PR_FGD, -1)
    torso = _trapezoid(chin, 0.5 * wide, chin[1] + 0.6 * tall, 1.2 * wide)
    cv2.fillPoly(labels, [torso], cv2.GC_PR_FGD)
    neck = _trapezoid(chin, 0.25 * wide, chin[1] + 0.5 * tall, 0.6 * wide)
    cv2.fillPoly(labels, [neck], cv2.GC_FGD)
    _seed_chest(labels, chin, wide, tall)
    labels[inside_face(shape, landmarks)] = cv2.GC_FGD
    return labels


def inside_face(shape: tuple[int, ...], landmarks: np.ndarray) -> np.ndarray:
    """(h, w) bool: within the outline of a face with landmarks (478, 2) in pixels."""
    import cv2

    inside = np.zeros(shape[:2], np.uint8)
    cv2.fillPoly(inside, [landmarks[FACE_OVAL].round().astype(np.int32)], 1)
    return inside > 0


def _seed_chest(labels: np.ndarray, chin: np.ndarray, wide: float, tall: float) -> None:
    """Whoever speaks into a camera has a chest at the lower edge, about two faces wide."""
    import cv2

    height, width = labels.shape
    top = round(max(chin[1] + 0.3 * tall, height - 0.06 * tall))
    left, right = round(chin[0] - 0.9 * wide), round(chin[0] + 0.9 * wide)
    labels[top:, max(left, 0) : min(right, width)] = cv2.GC_FGD


def _trapezoid(top: np.ndarray, half_top: float, bottom: float, half_bottom: float) -> np.ndarray:
    """Corners (4, 2) int32 of a symmetric trapezoid below a point."""
    x, y = top
    corners = [[x - half_top, y], [x + half_top, y], [x + half_bottom, bottom]]
    return np.array([*corners, [x - half_bottom, bottom]]).round().astype(np.int32)


def learn(images: list[np.ndarray], landmarks: np.ndarray) -> Models:
    """Learns colours and the clean plate from a few frames.

    Args:
        images: uint8 RGB pictures (h, w, 3) in working size, spread over the clip.
        landmarks: (F, 478, 2) in pixels of these pictures.
    """
    import cv2

    person, background = np.zeros((1, 65)), np.zeros((1, 65))
    # One tall picture of all frames, so that one pair of colour models serves them all.
    labels = np.concatenate([seeds(i.shape, f) for i, f in zip(images, landmarks, strict=True)])
    tall = np.concatenate(images)
    # What may be either must teach neither: the models start on the rest, then cut, then learn.
    sure = (labels != cv2.GC_PR_BGD).reshape(-1)
    pixels, classes = tall.reshape(-1, 1, 3)[sure], labels.reshape(-1, 1)[sure]
    cv2.grabCut(pixels, classes, None, background, person, 0, cv2.GC_INIT_WITH_MASK)  # type: ignore
    for mode, rounds in ((cv2.GC_EVAL_FREEZE_MODEL, 1), (cv2.GC_EVAL, 4)):
        cv2.grabCut(tall, labels, None, background, person, rounds, mode)  # type: ignore
    outside = ~_inside(labels).reshape(len(images), *images[0].shape[:2])
    plate, known = _plate(np.stack(images), outside)
    return Models(person, background, plate, known)


def cut(image: np.ndarray, landmarks: np.ndarray, models: Models) -> np.ndarray:
    """Cuts the person out of one picture.

    Args:
        image: uint8 RGB (H, W, 3).
        landmarks: (478, 2) pixels.
        models: Colours and plate that `learn` returned.

    Returns:
        (H, W) float32 in [0, 1], 1 on the person.
    """
    import cv2

    small = working(image)
    scale = small.shape[1] / image.shape[1]
    labels = seeds(small.shape, landmarks * scale)
    same = np.abs(small.astype(np.int16) - models.plate).max(-1) < 12
    labels[models.known & same & (labels != cv2.GC_FGD)] = cv2.GC_BGD
    person, background = models.person.copy(), models.background.copy()
    # type: ignore (its stub forgets that masks need no rectangle)
    cv2.grabCut(small, labels, None, background, person, 1, cv2.GC_EVAL_FREEZE_MODEL)
    rough = _largest(_inside(labels)).astype(np.float32)
    rough = cv2.resize(rough, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return _soft(image, rough)


def _soft(image: np.ndarray, rough: np.ndarray) -> np.ndarray:
    """Follows the picture's edges (guided filter) near the rough outline."""
    import cv2

    guide = image.astype(np.float32) / 255
    alpha = cv2.ximgproc.guidedFilter(guide, rough, 4, 1e-4)
    return np.clip((alpha - 0.1) / 0.8, 0, 1)


def _inside(labels: np.ndarray) -> np.ndarray:
    """Where GrabCut says person."""
    return (labels & 1) == 1


def _largest(mask: np.ndarray) -> np.ndarray:
    """The largest connected part, with small holes filled."""
    import cv2

    _, parts, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    if len(stats) < 2:
        return mask
    body = (parts == 1 + stats[1:, cv2.CC_STAT_AREA].argmax()).astype(np.uint8)
    return cv2.morphologyEx(body, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8)) > 0


def _plate(images: np.ndarray, outside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Median (h, w, 3) over the frames in which a pixel is background, and where there are any."""
    import cv2

    masked = np.ma.masked_array(images, np.repeat(~outside[..., None], 3, -1))
    median = np.ma.median(masked, axis=0).filled(0).astype(np.uint8)
    known = outside.sum(0) >= max(2, len(images) // 4)
    known = cv2.erode(known.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return median, known
