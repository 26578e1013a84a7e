"""Where speech is stressed: peaks of loudness, and when its words are spoken."""

import re
from dataclasses import dataclass

import numpy as np

from ico3d.rig.quaternions import Array

FRAME = 0.01
"""Seconds between two values of loudness."""
_WINDOW = 0.025
"""Seconds of sound that each value is of, around its time."""
_FLOOR = -80.0
_SMOOTH = 0.03
"""Standard deviation, in seconds, of the smoothing that leaves one peak to a syllable."""
SPOKEN = 25.0
"""Decibels below the loudest of the last seconds down to which somebody speaks."""
_MEMORY = 4.0
"""Seconds in which the loudest is looked for."""
SETTLED = 0.12
"""Seconds of sound that must be known behind a peak before it counts."""
_LEANING = 0.06
"""Seconds by which a word's time may be wrong: a peak so near it still is its own."""
_PAUSE = 0.1
"""Seconds of silence that no stop between two vowels is."""
_COMMA, _ASTRAY = 0.4, 0.3
"""Seconds of speech by which a comma attracts a pause, and words may be estimated amiss."""
_WORD = 0.35
"""Seconds of a word."""
UNKNOWN = "(unknown)"
"""A word that means no gesture."""
_VOWELS = re.compile(r"[aeiouyäöüáéíóúàèùâêîôû]+")


@dataclass(frozen=True)
class Word:
    """A word and when it is spoken.

    Attributes:
        text: As it is written.
        begin: Seconds.
        end: Seconds.
    """

    text: str
    begin: float
    end: float


@dataclass(frozen=True)
class Accent:
    """A stressed syllable.

    Attributes:
        time: Seconds of its loudest moment.
        strength: Decibels next to the loudest of the seconds before it; ≤ 0 but for its smoothing.
        word: Index of the word it belongs to.
    """

    time: float
    strength: float
    word: int


def loudness(samples: np.ndarray, rate: int) -> Array:
    """(n,) decibels of sound (S,) in −1 … 1, every `FRAME` seconds; value i is at i · FRAME."""
    count = int(len(samples) / rate / FRAME)
    return _decibels(samples, _middles(0, count, rate), _half(rate))


def _half(rate: int) -> int:
    """Samples of half a window."""
    return max(1, round(0.5 * _WINDOW * rate))


def _middles(first: int, last: int, rate: int) -> Array:
    """(last − first,) samples in the middle of the windows of these values."""
    return np.round(np.arange(first, last) * FRAME * rate).astype(int)


def _decibels(samples: np.ndarray, middles: Array, half: int) -> Array:
    """(n,) of the windows about (n,) samples."""
    power = np.concatenate([[0.0], np.cumsum(np.asarray(samples, float) ** 2)])
    first, last = np.maximum(middles - half, 0), np.minimum(middles + half, len(samples))
    mean = (power[last] - power[first]) / np.maximum(last - first, 1)
    return np.maximum(10 * np.log10(np.maximum(mean, 1e-12)), _FLOOR)


class GrowingLoudness:
    """Loudness of sound that comes piece by piece."""

    def __init__(self, rate: int):
        """No sound yet, of a rate in Hz."""
        self.levels: Array = np.zeros(0)
        self._rate, self._half = rate, _half(rate)
        self._kept, self._first = np.zeros(0), 0  # the last samples, and the first one's number

    def push(self, samples: np.ndarray) -> None:
        """Takes sound (S,) in −1 … 1; `levels` gets all values whose windows are known now."""
        self._kept = np.concatenate([self._kept, samples])
        count, known = len(self.levels), self._first + len(self._kept)
        middles = _middles(count, int(known / self._rate / FRAME) + 1, self._rate)
        middles = middles[middles + self._half <= known]
        new = _decibels(self._kept, middles - self._first, self._half)
        self.levels = np.concatenate([self.levels, new])
        next_ = round((count + len(new)) * FRAME * self._rate)
        past = max(next_ - self._half - self._first, 0)
        self._kept, self._first = self._kept[past:], self._first + past


def smoothed(levels: Array) -> Array:
    """(n,) with one peak to a syllable; looks three standard deviations ahead."""
    reach = round(3 * _SMOOTH / FRAME)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) * FRAME / _SMOOTH) ** 2)
    padded = np.pad(levels, reach, constant_values=_FLOOR)
    windows = np.lib.stride_tricks.sliding_window_view(padded, len(window))  # (n, 2 reach + 1)
    return windows @ (window / window.sum())


def _recent_loudest(levels: Array) -> Array:
    """(n,) the loudest of the last seconds, up to and with each."""
    span = round(_MEMORY / FRAME)
    padded = np.pad(levels, (span - 1, 0), constant_values=_FLOOR)
    return np.lib.stride_tricks.sliding_window_view(padded, span).max(-1)


def timed_words(text: str, levels: Array, begin: float, end: float) -> tuple[Word, ...]:
    """When the words of a sentence are spoken, as far as its sound tells.

    The time in which there is sound is shared among them by their syllables and letters; each pause
    of the sound is taken for that end of a word which is nearest to it, rather one with a comma.

    Args:
        text: The sentence.
        levels: Loudness of the whole utterance from its beginning.
        begin: Seconds where the sentence begins.
        end: Seconds where it ends.
    """
    texts = [word for word in text.split() if re.search(r"\w", word)]
    first, last = round(begin / FRAME), min(round(end / FRAME), len(levels))
    if not texts or last <= first:
        return ()
    spoken = levels[first:last] > levels[first:last].max() - SPOKEN
    voiced = np.concatenate([[0], np.cumsum(spoken)])  # frames with sound before each
    sizes = np.cumsum([0.0, *(_size(word) for word in texts)])
    shares = _at_pauses(texts, sizes / sizes[-1] * voiced[-1], spoken, voiced)
    starts = np.searchsorted(voiced, np.floor(shares[:-1] + 1e-9), side="right") - 1
    ends = np.searchsorted(voiced, np.floor(shares[1:] + 1e-9), side="left")
    return tuple(
        Word(word, begin + FRAME * float(a), begin + FRAME * float(b))
        for word, a, b in zip(texts, starts, ends, strict=True)
    )


def unknown_words(levels: Array) -> tuple[Word, ...]:
    """Words that nobody wrote down: stretches of sound, each about as long as a word.

    Args:
        levels: Loudness of the whole utterance.
    """
    voiced = int((levels > levels.max(initial=_FLOOR) - SPOKEN).sum()) * FRAME
    count = round(voiced / _WORD)
    return timed_words(" ".join([UNKNOWN] * count), levels, 0.0, len(levels) * FRAME)


def _at_pauses(texts: list[str], shares: Array, spoken: np.ndarray, voiced: np.ndarray) -> Array:
    """(N + 1,) ends of words in frames with sound, moved to where the pauses are."""
    commas = np.array([word[-1] in ",.;:!?" for word in texts[:-1]])
    distance_of = np.where(commas, -_COMMA, 0.0) / FRAME
    fixed = {0: shares[0], len(texts): shares[-1]}
    for at in _pauses(spoken, voiced):
        distance = np.abs(shares[1:-1] - at) + distance_of
        if len(distance) and distance.min() < _ASTRAY / FRAME:
            fixed.setdefault(1 + int(np.argmin(distance)), at)
    known = sorted(fixed)
    places = [fixed[number] for number in known]
    if np.any(np.diff(places) <= 0):
        return shares
    return np.interp(shares, shares[known], places)


def _pauses(spoken: np.ndarray, voiced: np.ndarray) -> list[float]:
    """Frames with sound before each pause between the first and the last of them."""
    ends = np.flatnonzero(np.diff(np.concatenate([[1], spoken, [1]]).astype(int)))
    runs = ends.reshape(-1, 2)
    return [
        float(voiced[a])
        for a, b in runs
        if (b - a) * FRAME >= _PAUSE and 0 < voiced[a] < voiced[-1]
    ]


def _size(word: str) -> float:
    """How long a word takes, next to others: by syllables and letters."""
    if word.strip(".,;:!?").isdigit():
        return 2.0 * len(word)
    return 1.0 * max(1, len(_VOWELS.findall(word.lower()))) + 0.25 * len(word)


def accents(words: tuple[Word, ...], levels: Array, ended: bool) -> tuple[Accent, ...]:
    """The stressed syllable of each word whose sound is known.

    It is the highest peak of the smoothed loudness within the word; a word without a peak has
    none. More sound behind does not change what was found.

    Args:
        words: In the order of time.
        levels: Loudness known so far.
        ended: Whether no more comes.
    """
    if not len(levels):
        return ()
    smooth = smoothed(levels)
    loudest = _recent_loudest(smooth)
    rises = np.diff(smooth, prepend=_FLOOR) > 0
    falls = np.diff(smooth, append=_FLOOR) <= 0
    peaks = rises & falls & (smooth > loudest - SPOKEN)
    known = len(levels) * FRAME - (0.0 if ended else SETTLED)
    found: list[Accent] = []
    for number, word in enumerate(words):
        if word.end + _LEANING > known and not ended:
            break
        first = max(round((word.begin - _LEANING) / FRAME), 0)
        last = min(round((word.end + _LEANING) / FRAME), len(levels) - 1)
        inside = first + np.flatnonzero(peaks[first : last + 1])
        if len(inside):
            best = int(inside[np.argmax(smooth[inside])])
            if not found or best * FRAME > found[-1].time:
                strength = float(smooth[best] - loudest[best])
                found.append(Accent(best * FRAME, strength, number))
    return tuple(found)
