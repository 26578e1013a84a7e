"""Sound files that lie beside pictures."""

from pathlib import Path

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.common.sound import Claim, fault, file_claim
from ico3d.errors import CaptureError

RATE = 16_000


def read_sound_file(path: Path, wanted: int = RATE) -> Sound | None:
    """A sound file as mono, or None where there is none.

    Args:
        path: Of any kind that libsndfile reads.
        wanted: Samples per second of the result.

    Raises:
        CaptureError: If it is damaged, or claims what is not taken.
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
    """Judges a sound before it is decoded or resampled.

    Raises:
        CaptureError: If it claims what is not taken.
    """
    wrong = fault(claim)
    if wrong:
        raise CaptureError(f"{place}: its sound {wrong}.")


def mono(samples: np.ndarray, rate: int, wanted: int = RATE) -> Sound:
    """Samples (S,) or (S, channels) float32 of a judged rate as mono at another, 16 kHz."""
    import soxr

    one = samples.mean(1) if samples.ndim == 2 else samples
    if rate != wanted:
        one = soxr.resample(one, rate, wanted, quality="VHQ")
    return Sound(np.asarray(one, np.float32), wanted)
