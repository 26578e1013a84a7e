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
    import soxr

    if not path.is_file():
        return None
    try:
        samples, rate = soundfile.read(path, dtype="float32")
    except (OSError, ValueError, RuntimeError) as error:
        raise CaptureError(f"{path} cannot be read: {error}.") from error
    mono = samples.mean(1) if samples.ndim == 2 else samples
    if rate != wanted:
        mono = soxr.resample(mono, rate, wanted, quality="VHQ")
    return Sound(np.asarray(mono, np.float32), wanted)
