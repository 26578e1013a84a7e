"""Sound files that lie beside pictures."""

from pathlib import Path

import numpy as np

from ico3d.capture.capture import Sound
from ico3d.errors import CaptureError

RATE = 16_000


def read_sound_file(path: Path, wanted: int = RATE) -> Sound | None:
    """A sound file as mono, or None where there is none.

    Args:
        path: Of any kind that libsndfile reads.
        wanted: Samples per second of the result.

    Raises:
        CaptureError: If it is damaged.
    """
    import soundfile

    if not path.is_file():
        return None
    try:
        samples, rate = soundfile.read(path, dtype="float32")
    except (OSError, ValueError, RuntimeError) as error:
        raise CaptureError(f"{path} cannot be read: {error}.") from error
    return mono(samples, rate, wanted)


def mono(samples: np.ndarray, rate: int, wanted: int = RATE) -> Sound:
    """Samples (S,) or (S, channels) float32 of any rate as mono at a rate, 16 kHz by default."""
    import soxr

    one = samples.mean(1) if samples.ndim == 2 else samples
    if rate != wanted:
        one = soxr.resample(one, rate, wanted, quality="VHQ")
    return Sound(np.asarray(one, np.float32), wanted)
