"""Speech synthesis with espeak-ng, which also tells the time of every phoneme.

Training uses the phonemes as ground truth; without a network, espeak-ng can serve as a voice. The
library (GPL-3) comes with the package `espeakng-loader`; a process of its own speaks
(`process.py`).
"""

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from ico3d.common.espeak.process import Request, ask
from ico3d.common.native.isolated import LostError, RefusedError
from ico3d.errors import MissingExtraError, ServiceError, SettingsError

_VOICELESS_STOPS = ("p", "t", "k", "q", "c", "ʈ")
_STEP = 0.005  # s, resolution of the search for a closure
_MAX_CLOSURE = 0.12  # s
_QUIET = 0.06  # of the sound before: quieter than this, a voiceless stop is closed


@dataclass(frozen=True)
class Phoneme:
    """One speech sound; it lasts until the next one begins.

    Attributes:
        time: When the articulation begins, in seconds from the start of the sound; for stop
            consonants, when the mouth closes.
        symbol: IPA with stress and length marks; the empty string stands for a pause.
    """

    time: float
    symbol: str


@dataclass(frozen=True)
class Speech:
    """A synthesised text.

    Attributes:
        samples: (S,) float32 in [-1, 1].
        rate: Samples per second.
        events: The phonemes in the order of time, pauses included.
    """

    samples: np.ndarray
    rate: int
    events: tuple[Phoneme, ...]


def synthesize(
    text: str, voice: str = "en-us", rate: int = 170, pitch: int = 50, pitch_range: int = 50
) -> Speech:
    """Speaks a text; the same arguments give the same samples.

    Any thread may call this function; calls wait for each other.

    Args:
        text: What to say, in the language of the voice.
        voice: Language and, after `+`, a variant: `en-us`, `de+f3`, `fr+klatt2`.
        rate: Words per minute, 80 to 450.
        pitch: Pitch of the voice, 0 to 100.
        pitch_range: How far the pitch moves: 0 (monotone) to 100.

    Raises:
        MissingExtraError: If espeakng-loader is not installed.
        SettingsError: If espeak-ng has no such voice.
        ServiceError: If espeak-ng fails at the text.
    """
    if find_spec("espeakng_loader") is None:
        raise MissingExtraError("espeakng-loader", "voice", "the espeak-ng voice")
    try:
        answer = ask(Request(text, voice, rate, pitch, pitch_range))
    except RefusedError as error:
        raise SettingsError(str(error)) from None
    except LostError:
        raise ServiceError("espeak-ng failed at a text.") from None
    samples = np.frombuffer(answer.pcm, np.int16).astype(np.float32) / 32768  # (S,)
    return Speech(samples, answer.rate, _timed(answer.marks, samples, answer.rate))


def _timed(marks: list[tuple[int, str]], samples: np.ndarray, rate: int) -> tuple[Phoneme, ...]:
    """Phonemes with the time at which each articulation begins.

    espeak-ng marks a voiceless stop at its burst and counts the silent closure before it to the
    sound before; lips, however, close when the silence begins.
    """
    phonemes: list[Phoneme] = []
    previous = 0
    for sample, symbol in sorted(marks, key=lambda mark: mark[0]):
        start = sample
        if symbol.lstrip("ˈˌ").startswith(_VOICELESS_STOPS) and phonemes:
            start = _closure_start(samples, previous, sample, rate)
        phonemes.append(Phoneme(start / rate, symbol))
        previous = sample
    return tuple(phonemes)


def _closure_start(samples: np.ndarray, previous: int, burst: int, rate: int) -> int:
    """The first sample of the quiet stretch that ends at a burst, after `previous`."""
    step = int(_STEP * rate)
    before = samples[max(previous, burst - int(3 * _MAX_CLOSURE * rate)) : burst]
    if len(before) == 0:
        return burst
    limit = _QUIET * float(np.abs(before).max())
    earliest = max(previous, burst - int(_MAX_CLOSURE * rate))
    start = burst
    while start - step >= earliest and float(np.abs(samples[start - step : start]).max()) <= limit:
        start -= step
    return start
