"""The clean plate: what the camera sees without the person."""

import numpy as np

SAMPLES = 24
"""Number of frames whose median makes the plate."""


def clean_plate(images: list[np.ndarray], alphas: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """Median of background pixels, with a smooth guess where background is never visible.

    Args:
        images: uint8 RGB (H, W, 3) pictures.
        alphas: (H, W) mask of the person in each picture.

    Returns:
        uint8 RGB (H, W, 3), and the share of pixels where background was visible.
    """
    import cv2

    near = np.ones((7, 7), np.uint8)
    hidden = np.stack([cv2.dilate((a > 0.02).astype(np.uint8), near) > 0 for a in alphas])
    masked = np.ma.masked_array(np.stack(images), np.repeat(hidden[..., None], 3, -1))
    seen = np.asarray(~hidden.all(0))
    plate = np.ma.median(masked, axis=0).filled(0).astype(np.float32)
    return filled(plate, seen).round().astype(np.uint8), float(seen.mean())


def mismatch(plate: np.ndarray, images: list[np.ndarray], alphas: list[np.ndarray]) -> float:
    """Mean difference, 0 to 1, between plate and background pixels; median over the pictures."""
    around = [alpha < 0.01 for alpha in alphas]
    return float(
        np.median(
            [
                np.abs(image[out].astype(np.float32) - plate[out]).mean() / 255 if out.any() else 0
                for image, out in zip(images, around, strict=True)
            ]
        )
    )


def filled(image: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Fills unseen pixels from their surroundings, by a pyramid of halved pictures.

    Args:
        image: (H, W, 3) float32.
        seen: (H, W) bool, pixels with a known value.
    """
    import cv2

    if seen.all() or not seen.any() or min(seen.shape) < 2:
        return image if seen.any() else np.full_like(image, 127.0)
    weight = seen.astype(np.float32)
    half = ((image.shape[1] + 1) // 2, (image.shape[0] + 1) // 2)
    small_weight = cv2.resize(weight, half, interpolation=cv2.INTER_AREA)
    small = cv2.resize(image * weight[..., None], half, interpolation=cv2.INTER_AREA)
    small = small / np.maximum(small_weight, 1e-6)[..., None]
    small = filled(small, small_weight > 1e-3)
    guess = cv2.resize(small, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return np.where(seen[..., None], image, guess)
