"""Reads sound files of captures."""

from pathlib import Path

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.common.sound import Claim, fault, file_claim
from ico3d.errors import CaptureError

RATE = 16_000


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

    if not path.is_file():
        return None
    try:
        check_claim(path, file_claim(path))
        samples, rate = soundfile.read(path, dtype="float32")
    except (OSError, ValueError, RuntimeError) as error:
        raise CaptureError(f"{path} cannot be read: {error}.") from error
    return mono(samples, rate, wanted)


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
    import soxr

    one = samples.mean(1) if samples.ndim == 2 else samples
    if rate != wanted:
        one = soxr.resample(one, rate, wanted, quality="VHQ")
    return Sound(np.asarray(one, np.float32), wanted)
