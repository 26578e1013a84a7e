"""Chooses the cleanest stretches of speech of a recording."""

from dataclasses import dataclass

import numpy as np
import soxr

from ico3d.capture.capture import Sound
from ico3d.chat.turns.detector import EagerSilero
from ico3d.chat.wire.protocol import MICROPHONE_RATE
from ico3d.creating.looking.advice import Advice
from ico3d.creating.looking.sound_checks import ABOVE_NOISE, SILENT, clips, loudness

FRAME = 512
"""Samples at 16 kHz of which Silero says whether they are speech: 32 ms."""
SPEECH = 0.5
"""Silero's confidence from which on they are."""
BRIDGED, SHORTEST = 0.13, 0.6
"""Seconds of a break that does not end a stretch, and of the shortest stretch that is taken."""
AROUND, PIECE, SOFTEST = 2.0, 0.05, 0.1
"""Noise is the softest tenth of the pieces, of so many seconds, as far around a stretch as that."""
LEAST, MOST = 10.0, 60.0
"""Seconds of clean speech that a voice needs, and that are taken at most."""
LEVEL, PEAK = -23.0, 0.98
"""Loudness to which each stretch is brought, decibels of full scale, and its largest sample."""
FADE, APART = 0.01, 0.1
"""Seconds over which a stretch begins and ends, and of silence between two."""


@dataclass(frozen=True)
class Speech:
    """What was chosen of a recording.

    Attributes:
        samples: (S,) float32 the stretches one behind the other, equally loud.
        seconds: Seconds of speech in them.
        fault: Why they cannot tell a voice; None where they can.
    """

    samples: np.ndarray
    seconds: float
    fault: Advice | None = None


def clean_speech(sound: Sound | None) -> Speech:
    """The cleanest speech of a recording.

    Args:
        sound: Sound of the recording; None where it has none.
    """
    if sound is None or not len(sound.samples):
        return _none("voice-none")
    found = stretches(is_speech(sound), FRAME / MICROPHONE_RATE)
    heard = sum(end - begin for begin, end in found)
    if heard < LEAST:
        if loudness(sound.samples) < SILENT:
            return _none("voice-silent")
        return _none("voice-short", heard)
    clean = _cleanest(sound, found)
    seconds = sum(end - begin for begin, end in clean)
    if seconds < LEAST:
        return _none("voice-noisy", seconds)
    pause = np.zeros(round(APART * sound.rate), np.float32)
    pieces = [part for span in clean for part in (_levelled(_cut(sound, span), sound.rate), pause)]
    return Speech(np.concatenate(pieces), seconds)


def is_speech(sound: Sound) -> np.ndarray:
    """(F,) whether each 32 ms of a recording are speech, as Silero hears it."""
    samples = soxr.resample(sound.samples, sound.rate, MICROPHONE_RATE)
    frames = samples[: len(samples) // FRAME * FRAME].reshape(-1, FRAME)  # (F, 512)
    pcm = ((frame.clip(-1, 1) * 32767).astype(np.int16) for frame in frames)
    silero = EagerSilero(pause=0.2)
    silero.set_sample_rate(MICROPHONE_RATE)
    confidence = [np.ravel(silero.voice_confidence(frame.tobytes())) for frame in pcm]  # (1,) each
    return np.array(confidence).reshape(-1) >= SPEECH


def stretches(speech: np.ndarray, step: float) -> list[tuple[float, float]]:
    """Begin and end in seconds of each stretch of speech, short breaks bridged.

    Args:
        speech: (F,) whether each step of a recording is speech.
        step: Seconds of a step.
    """
    edges = np.flatnonzero(np.diff(speech, prepend=False, append=False)).reshape(-1, 2)
    found: list[tuple[float, float]] = []
    for first, last in edges * step:
        if found and first - found[-1][1] <= BRIDGED:
            found[-1] = found[-1][0], float(last)
        else:
            found.append((float(first), float(last)))
    return [(begin, end) for begin, end in found if end - begin >= SHORTEST]


def _cleanest(sound: Sound, found: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The stretches that stand most above the noise, by time; none that is noisy or clipped."""
    above = {span: float(loudness(_cut(sound, span))) - _noise(sound, span) for span in found}
    taken: list[tuple[float, float]] = []
    for begin, end in sorted(found, key=lambda span: -above[span]):
        room = MOST - sum(b - a for a, b in taken)
        if room < SHORTEST or above[begin, end] < ABOVE_NOISE:
            break
        if not clips(_cut(sound, (begin, end))[None])[0]:
            taken.append((begin, min(end, begin + room)))
    return sorted(taken)


def _noise(sound: Sound, span: tuple[float, float]) -> float:
    """Loudness of what is heard between the words of a stretch and just before and behind it."""
    near = _cut(sound, (max(span[0] - AROUND, 0.0), span[1] + AROUND))
    length = round(PIECE * sound.rate)
    pieces = near[: len(near) // length * length].reshape(-1, length)  # (P, n)
    return float(np.quantile(loudness(pieces), SOFTEST))


def _cut(sound: Sound, span: tuple[float, float]) -> np.ndarray:
    begin, end = (round(second * sound.rate) for second in span)
    return sound.samples[begin:end]


def _levelled(samples: np.ndarray, rate: int) -> np.ndarray:
    """A stretch as loud as all others, without clicks at its ends."""
    gain = 10 ** ((LEVEL - float(loudness(samples))) / 20)
    gain = min(gain, PEAK / max(float(np.abs(samples).max()), 1e-9))
    fade = np.minimum(np.arange(len(samples)) / (FADE * rate), 1)
    return (samples * gain * fade * fade[::-1]).astype(np.float32)


def _none(code: str, seconds: float | None = None) -> Speech:
    """No speech, and the advice of that code; `seconds` are those that there are of it, if told."""
    told = {} if seconds is None else {"n": int(seconds), "least": round(LEAST)}
    return Speech(np.zeros(0, np.float32), 0.0, Advice(code, values=told))
