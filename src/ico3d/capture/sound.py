"""Reads sound files of captures."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.common.sound import Claim, fault, file_claim
from ico3d.errors import CaptureError

RATE = 16_000
BLOCK = 1 << 16
"""Samples of each channel of a file that are read at once."""


def read_sound_file(path: Path, wanted: int = RATE) -> Sound | None:
    """A sound file as mono; None if there is no file.

    Args:
        path: A file of any format that libsndfile reads.
        wanted: Samples per second of the result.

    Raises:
        CaptureError: If the file is damaged, or claims more than is accepted
            (`common.sound.fault`).
    """
    import soundfile

    if not os.path.isfile(path):
        return None
    try:
        check_claim(path, file_claim(path))
        with soundfile.SoundFile(path) as file:
            blocks = file.blocks(BLOCK, dtype="float32", always_2d=True)  # (≤ BLOCK, channels) each
            pieces = (block.mean(1) for block in blocks)
            return Sound(joined(pieces, file.samplerate, wanted), wanted)
    except (OSError, ValueError, TypeError, RuntimeError) as error:  # TypeError: raw sound
        raise CaptureError(f"{path} cannot be read: {error}.") from error


def check_claim(place: Path | str, claim: Claim) -> None:
    """Checks what a sound file claims before it is decoded or resampled.

    Raises:
        CaptureError: If the claim is refused by `common.sound.fault`.
    """
    wrong = fault(claim)
    if wrong:
        raise CaptureError(f"{place}: its sound {wrong}.")


def mono(samples: np.ndarray, rate: int, wanted: int = RATE) -> Sound:
    """Converts samples (S,) or (S, channels) float32 to mono at `wanted` samples per second."""
    one = samples.mean(1) if samples.ndim == 2 else samples
    return Sound(joined([one], rate, wanted), wanted)


def joined(pieces: Iterable[np.ndarray], rate: int, wanted: int, silence: int = 0) -> np.ndarray:
    """One sound of consecutive pieces, each of which is resampled as it comes and then let go.

    Args:
        pieces: (S,) float32 each, mono.
        rate: Samples per second of the pieces.
        wanted: Samples per second of the result.
        silence: Samples of silence in front of the result.

    Returns:
        (S,) float32.
    """
    # Grows in place: two hours at 16 kHz are 460 MB, and are there once.
    kept = bytearray(4 * silence)
    for piece in _resampled(pieces, rate, wanted):
        kept += np.ascontiguousarray(piece, np.float32).data
    return np.frombuffer(kept, np.float32)


def _resampled(pieces: Iterable[np.ndarray], rate: int, wanted: int) -> Iterator[np.ndarray]:
    """Pieces (S,) at other samples per second; the last one has what was held back."""
    if rate == wanted:
        yield from pieces
        return
    import soxr

    stream = soxr.ResampleStream(rate, wanted, 1, dtype="float32", quality="VHQ")
    for piece in pieces:
        yield stream.resample_chunk(np.ascontiguousarray(piece, np.float32))
    yield stream.resample_chunk(np.zeros(0, np.float32), last=True)
