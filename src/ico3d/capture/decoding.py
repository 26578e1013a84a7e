"""Decoding pictures, whole or not at all: half a JPEG is an error, not a grey half."""

import io
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from ico3d.errors import CaptureError

DAMAGED = (OSError, SyntaxError, ValueError, EOFError, Image.DecompressionBombError)
"""What Pillow raises for files it cannot read; a broken PNG is a SyntaxError to it."""


def decoded(source: Path | bytes, what: str) -> np.ndarray:
    """The pixels of a picture as they are stored: no rotation by metadata, no colour management.

    Args:
        source: A file, or what one holds.
        what: What an error calls the picture.

    Returns:
        uint8 (H, W, 3) RGB, or (H, W, 4) where there is transparency.

    Raises:
        CaptureError: If it is damaged or has more than 8 bits per value.
    """
    try:
        with Image.open(io.BytesIO(source) if isinstance(source, bytes) else source) as picture:
            if picture.mode[0] in "IF":
                raise CaptureError(f"{what} has more than 8 bits per value: convert it to 8 bits.")
            clear = "A" in picture.getbands() or "transparency" in picture.info
            return np.asarray(picture.convert("RGBA" if clear else "RGB"))
    except FileNotFoundError as error:
        raise CaptureError(f"{what} is missing.") from error
    except (UnidentifiedImageError, *DAMAGED) as error:
        raise CaptureError(f"{what} is damaged and cannot be decoded.") from error


def size_of(source: Path | bytes, what: str) -> tuple[int, int]:
    """Width and height of a picture; only its head is read.

    Raises:
        CaptureError: If it is missing or damaged.
    """
    try:
        with Image.open(io.BytesIO(source) if isinstance(source, bytes) else source) as picture:
            return picture.size
    except FileNotFoundError as error:
        raise CaptureError(f"{what} is missing.") from error
    except (UnidentifiedImageError, *DAMAGED) as error:
        raise CaptureError(f"{what} is damaged and cannot be decoded.") from error


def unit(picture: np.ndarray) -> np.ndarray:
    """Bytes as float32 in [0, 1]."""
    return picture.astype(np.float32) / np.float32(255)


def largest_channel(picture: np.ndarray) -> np.ndarray:
    """(H, W) the largest of red, green and blue: what mask pictures mean."""
    # Ten times as fast as a maximum along an axis of length 3.
    return np.maximum(np.maximum(picture[..., 0], picture[..., 1]), picture[..., 2])
