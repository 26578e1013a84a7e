"""Unlimited labelled speech: espeak-ng voices of many languages read random words."""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from ico3d.common.espeak.speech import Phoneme, synthesize
from ico3d.speech.articulation import articulation_track, viseme_track
from ico3d.speech.mel import HOP, RATE, WINDOW, mel_spectrogram, resampled
from ico3d.speech.training.augment import recorded


def _names(text: str) -> tuple[str, ...]:
    """Names between spaces."""
    return tuple(text.split())


LANGUAGES = _names("""
    en-us en-us en-us en-gb-x-rp en-gb-scotland en-029 de fr es es-419 it pt pt-br nl sv nb da fi
    pl cs hu tr ro hr ca sq id eo sw lv
""")
VARIANTS = _names("""
    m1 m2 m3 m4 m5 m7 m8 f1 f2 f3 f5 klatt klatt2 klatt3 klatt5 klatt6 adam Alex Alicia Andrea
    Andy anika antonio aunty belinda benjamin boris caleb david Denis Diogo ed edward gustave
    grandma grandpa Henrique Hugo ian iven iven3 Jacky john kaukovalta Lee linda marcelo Marco
    Mario miguel Mike norbert pablo paul pedro quincy Reed rob robert sandro shelby steph2
    Storm travis Tweaky victor zac whisper
""")
HELD_OUT_LANGUAGES = ("en-us-nyc", "sk", "et")
HELD_OUT_VARIANTS = ("m6", "f4", "klatt4", "Annie", "Michael", "steph", "max")

_LEAD_ROWS = 6.8
"""Mel rows from a window's first row to the time that it stands for: row i of a track begins at
mel row int(3.2·i − 6.4), on average 6.8 before 3.2·i."""


@dataclass(frozen=True)
class Batch:
    """Labelled utterances of equal length. M is the number of mel rows.

    Attributes:
        mel: (b, 80, M) float32 mel spectra.
        visemes: (b, M − 15) int64 viseme index of each window, at the time that the window
            describes.
        articulation: (b, M − 15, 5) float32 lip articulation of each window
            (`articulation.ARTICULATION`).
    """

    mel: np.ndarray
    visemes: np.ndarray
    articulation: np.ndarray


def make_batch(random: np.random.Generator, size: int, seconds: float, held_out: bool) -> Batch:
    """Synthesises a batch of random utterances.

    Args:
        random: Source of all random choices.
        size: b, number of utterances.
        seconds: Length of each utterance in seconds.
        held_out: Whether to use the voices, languages and words reserved for evaluation.

    Raises:
        MissingExtraError: If espeak-ng or soxr is not installed.
    """
    spoken = [utterance(random, seconds, held_out) for _ in range(size)]
    mels, shapes, values = [], [], []
    for index, (sound, phonemes) in enumerate(spoken):
        heard = recorded(sound, spoken[index - 1][0], random)
        mel = mel_spectrogram(heard)  # (M, 80)
        times = (np.arange(len(mel) - WINDOW + 1) + _LEAD_ROWS) * HOP / RATE  # (M − 15,)
        mels.append(mel.T)
        shapes.append(viseme_track(phonemes, seconds, times))
        values.append(articulation_track(phonemes, seconds, times))
    return Batch(np.stack(mels), np.stack(shapes), np.stack(values))


def utterance(
    random: np.random.Generator, seconds: float, held_out: bool
) -> tuple[np.ndarray, tuple[Phoneme, ...]]:
    """Clean random speech (S,) at 16 kHz of the given length in seconds, and its phonemes."""
    languages = HELD_OUT_LANGUAGES if held_out else LANGUAGES
    variants = HELD_OUT_VARIANTS if held_out else VARIANTS
    speech = synthesize(
        _text(random, seconds, held_out),
        f"{random.choice(languages)}+{random.choice(variants)}",
        rate=int(random.integers(110, 240)),
        pitch=int(random.integers(10, 90)),
        pitch_range=int(random.integers(20, 90)),
    )
    stretch = random.uniform(0.87, 1.17)  # moves pitch and formants: another vocal tract
    sound = resampled(speech.samples, round(speech.rate * stretch))
    begin = random.uniform(0, 1.2) if random.random() < 0.4 else -random.uniform(0, 1.0)
    offset = round(begin * RATE)
    track = np.zeros(round(seconds * RATE), np.float32)
    source = sound[max(0, -offset) :][: len(track) - max(0, offset)]
    track[max(0, offset) : max(0, offset) + len(source)] = source
    events = [Phoneme(e.time / stretch + offset / RATE, e.symbol) for e in speech.events]
    events.append(Phoneme((len(sound) + offset) / RATE, ""))
    return track, tuple(event for event in events if event.time < seconds)


def _text(random: np.random.Generator, seconds: float, held_out: bool) -> str:
    """Random words with punctuation, enough to fill the time at the fastest rate."""
    words = list(random.choice(_words(held_out), 4 + int(4.5 * seconds)))
    for index in random.integers(0, len(words), 3):
        words[index] += str(random.choice([",", ".", "?", "!", ";"]))
    return " ".join(words)


@cache
def _words(held_out: bool) -> list[str]:
    """Every eighth word is kept for evaluation."""
    text = files("ico3d.speech").joinpath("data/words.txt").read_text("utf-8")
    return [
        word for index, word in enumerate(sorted(set(text.split()))) if (index % 8 == 0) == held_out
    ]
