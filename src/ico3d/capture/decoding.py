"""Decodes pictures completely or not at all: a truncated JPEG is an error, not half grey."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image, UnidentifiedImageError

from ico3d.capture.vetting.chunks import has_large_chunks, is_bulky
from ico3d.capture.vetting.scans import has_many_scans
from ico3d.common.files import check_regular
from ico3d.errors import CaptureError

FORMATS = ("JPEG", "PNG")
"""Kinds of pictures that recordings have, by Pillow's names: some others start programs (EPS)."""
MOST_PIXELS = 8192 * 4320
"""Largest size of a picture, of a video too: what cameras record at most."""
MOST_SIDE = 16_384
"""Longest side of a picture: beyond 32,766, OpenCV within MediaPipe ends the whole process."""
DAMAGED = (OSError, SyntaxError, ValueError, EOFError)
"""What Pillow raises for files that it cannot read; SyntaxError stands for a broken PNG."""


def decoded(source: Path | bytes, what: str) -> np.ndarray:
    """The pixels of a picture as stored: without rotation by metadata or colour management.

    Args:
        source: A file, or the content of one.
        what: Name of the picture in errors.

    Returns:
        uint8 (H, W, 3) RGB, or (H, W, 4) RGBA where the file has transparency.

    Raises:
        CaptureError: If the picture is damaged, larger than is taken, or has more than 8 bits per
            value.
    """
    with _opened(source, what) as picture:
        if picture.mode[0] in "IF":
            raise CaptureError(f"{what} has more than 8 bits per value: convert it to 8 bits.")
        wanted = "RGBA" if _is_clear(picture) else "RGB"
        return np.asarray(picture if picture.mode == wanted else picture.convert(wanted))


def size_of(source: Path | bytes, what: str) -> tuple[int, int]:
    """Width and height of a picture in pixels, from the file's header alone.

    Raises:
        CaptureError: If the picture is missing, damaged or larger than is taken.
    """
    with _opened(source, what) as picture:
        return picture.size


def has_opacity(source: Path | bytes, what: str) -> bool:
    """Whether a picture has transparent parts, from the file's header alone.

    Raises:
        CaptureError: If the picture is missing, damaged or larger than is taken.
    """
    with _opened(source, what) as picture:
        return _is_clear(picture)


def open_picture(
    source: Path | bytes, what: str, formats: tuple[str, ...] = FORMATS
) -> Image.Image:
    """Opens a picture of anybody by its header; its pixels are decoded when they are asked for.

    Args:
        source: A file, or the content of one.
        what: Name of the picture in errors.
        formats: Kinds that are taken, by Pillow's names.

    Returns:
        The picture, to be closed by the caller.

    Raises:
        CaptureError: If it is larger than is taken, or has more passes (`has_many_scans`), or more
            beside its pixels (`has_large_chunks`).
        OSError: If it is missing, damaged, no regular file or of another kind; others of `DAMAGED`
            too.
    """
    if isinstance(source, Path):
        check_regular(source)
    stream = io.BytesIO(source) if isinstance(source, bytes) else source
    # Before Pillow, which reads all of it.
    _refuse_if(is_bulky, source, f"{what}: the picture's file is larger than is taken.")
    beside = f"{what}: the picture has more beside its pixels than cameras make."
    _refuse_if(has_large_chunks, source, beside)
    try:
        picture = Image.open(stream, formats=formats)
    except Image.DecompressionBombError as error:
        raise CaptureError(f"{what}: the picture is larger than is taken.") from error
    try:
        check_size(what, *picture.size)
        passes = f"{what}: the picture has more passes than cameras make."
        _refuse_if(has_many_scans, source, passes)
    except CaptureError:
        picture.close()
        raise
    return picture


def _refuse_if(found: Callable[[BinaryIO], bool], source: Path | bytes, sentence: str) -> None:
    """Raises a CaptureError with this sentence where something is found in a picture's file."""
    with io.BytesIO(source) if isinstance(source, bytes) else source.open("rb") as file:
        if found(file):
            raise CaptureError(sentence)


def check_size(what: str, width: int, height: int) -> None:
    """Refuses a picture that is larger than is taken, before it is decoded or looked at.

    Args:
        what: Name of the picture, or of the video, in the error.
        width: Its width in pixels.
        height: Its height in pixels.

    Raises:
        CaptureError: If it has more than `MOST_PIXELS` or a side longer than `MOST_SIDE`.
    """
    if width * height > MOST_PIXELS or max(width, height) > MOST_SIDE:
        raise CaptureError(
            f"{what}: a picture of {width}×{height} pixels is larger than is taken, which is "
            f"{MOST_PIXELS} pixels and {MOST_SIDE} on a side: scale it down."
        )


def unit(picture: np.ndarray) -> np.ndarray:
    """Converts uint8 to float32 in [0, 1]."""
    return picture.astype(np.float32) / np.float32(255)


def to_bytes(picture: np.ndarray) -> np.ndarray:
    """Converts floats in [0, 1] to uint8, rounded."""
    return (picture * 255 + 0.5).astype(np.uint8)


def largest_channel(picture: np.ndarray) -> np.ndarray:
    """(H, W) maximum of red, green and blue, which is the value of mask pictures."""
    # Ten times as fast as a maximum along an axis of length 3.
    return np.maximum(np.maximum(picture[..., 0], picture[..., 1]), picture[..., 2])


@contextmanager
def _opened(source: Path | bytes, what: str) -> Iterator[Image.Image]:
    """An open picture; what Pillow cannot read within is one sentence."""
    try:
        with open_picture(source, what) as picture:
            yield picture
    except FileNotFoundError as error:
        raise CaptureError(f"{what} is missing.") from error
    except (UnidentifiedImageError, *DAMAGED) as error:
        raise CaptureError(f"{what} is damaged and cannot be decoded.") from error


def _is_clear(picture: Image.Image) -> bool:
    """Whether a picture has transparent parts."""
    return "A" in picture.getbands() or "transparency" in picture.info
