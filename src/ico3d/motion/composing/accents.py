"""Finds the stresses of speech, at peaks of loudness, and estimates when words are spoken."""

import re
from dataclasses import dataclass

import numpy as np

from ico3d.rig.quaternions import Array

FRAME = 0.01
"""Seconds between two values of loudness."""
_WINDOW = 0.025
"""Duration in seconds of the sound around its time that a value of loudness measures."""
_FLOOR = -80.0
"""Least value of loudness, dB."""
_SMOOTH = 0.03
"""Standard deviation, in seconds, of the smoothing that leaves one peak per syllable."""
SPOKEN = 25.0
"""Sound counts as speech down to this many dB below the loudest value."""
_MEMORY = 4.0
"""Seconds before a moment in which the loudest value is looked for."""
SETTLED = 0.12
"""Seconds of sound after a peak that must be known before the peak counts."""
_LEANING = 0.06
"""Error in seconds of a word's estimated time: a peak within it still belongs to the word."""
_PAUSE = 0.1
"""Least duration of a pause in seconds; stop consonants are shorter silences."""
_COMMA, _ASTRAY = 0.4, 0.3
"""How pauses are matched with ends of words, in seconds of speech.

Ends with a comma count as nearer by the first number; a pause farther than the second one from all
ends belongs to none.
"""
_WORD = 0.35
"""Mean duration of a word in seconds."""
UNKNOWN = "(unknown)"
"""Text of a word that is not known; it means no gesture."""
_VOWELS = re.compile(r"[aeiouyäöüáéíóúàèùâêîôû]+")


@dataclass(frozen=True)
class Word:
    """A word with the time at which it is spoken.

    Attributes:
        text: The word as it is written, with punctuation.
        begin: Seconds from the beginning of the utterance.
        end: Seconds from the beginning of the utterance.
    """

    text: str
    begin: float
    end: float


@dataclass(frozen=True)
class Accent:
    """A stressed syllable.

    Attributes:
        time: Time of the loudest moment of the syllable, seconds.
        strength: Loudness in dB relative to the loudest of the last seconds; not above 0.
        word: Index of the word that the syllable belongs to.
    """

    time: float
    strength: float
    word: int


def loudness(samples: np.ndarray, rate: int) -> Array:
    """(n,) loudness in dB every `FRAME` seconds; value i is that at i · FRAME seconds.

    Args:
        samples: (S,) sound in −1 … 1.
        rate: Samples per second.
    """
    count = int(len(samples) / rate / FRAME)
    return _decibels(samples, _middles(0, count, rate), _half(rate))


def _half(rate: int) -> int:
    """Number of samples in half a window."""
    return max(1, round(0.5 * _WINDOW * rate))


def _middles(first: int, last: int, rate: int) -> Array:
    """(last − first,) indices of the samples at the middle of windows number `first` to `last`."""
    return np.round(np.arange(first, last) * FRAME * rate).astype(int)


def _decibels(samples: np.ndarray, middles: Array, half: int) -> Array:
    """(n,) mean power in dB of windows of ±`half` samples about the samples `middles` (n,)."""
    power = np.concatenate([[0.0], np.cumsum(np.asarray(samples, float) ** 2)])
    first, last = np.maximum(middles - half, 0), np.minimum(middles + half, len(samples))
    mean = (power[last] - power[first]) / np.maximum(last - first, 1)
    return np.maximum(10 * np.log10(np.maximum(mean, 1e-12)), _FLOOR)


class GrowingLoudness:
    """Loudness of sound that arrives piece by piece.

    Attributes:
        levels: (n,) values known so far, equal to those of `loudness`.
    """

    def __init__(self, rate: int):
        """Makes an empty one for sound of `rate` samples per second."""
        self.levels: Array = np.zeros(0)
        self._rate, self._half = rate, _half(rate)
        self._kept, self._first = np.zeros(0), 0  # the last samples, and the index of their first

    def push(self, samples: np.ndarray) -> None:
        """Appends sound (S,) in −1 … 1, and to `levels` all values whose windows are complete."""
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
    """(n,) loudness smoothed so that each syllable has one peak; looks 3 `_SMOOTH` ahead."""
    reach = round(3 * _SMOOTH / FRAME)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) * FRAME / _SMOOTH) ** 2)
    padded = np.pad(levels, reach, constant_values=_FLOOR)
    windows = np.lib.stride_tricks.sliding_window_view(padded, len(window))  # (n, 2 reach + 1)
    return windows @ (window / window.sum())


def _recent_loudest(levels: Array) -> Array:
    """(n,) for each value the loudest of the last `_MEMORY` seconds, itself included."""
    span = round(_MEMORY / FRAME)
    padded = np.pad(levels, (span - 1, 0), constant_values=_FLOOR)
    return np.lib.stride_tricks.sliding_window_view(padded, span).max(-1)


def timed_words(text: str, levels: Array, begin: float, end: float) -> tuple[Word, ...]:
    """Estimates when the words of a sentence are spoken, from text and loudness.

    The time with sound is divided among the words by their numbers of syllables and letters. Each
    pause in the sound is then taken as the nearest end of a word, with preference for ends with a
    comma or other punctuation.

    Args:
        text: The sentence.
        levels: (n,) loudness of the whole utterance from its beginning, dB.
        begin: Time in the utterance at which the sentence begins, seconds.
        end: Time at which the sentence ends, seconds.

    Returns:
        The words in order of time; none where there is no sound.
    """
    texts = [word for word in text.split() if re.search(r"\w", word)]
    first, last = round(begin / FRAME), min(round(end / FRAME), len(levels))
    if not texts or last <= first:
        return ()
    spoken = levels[first:last] > levels[first:last].max() - SPOKEN
    voiced = np.concatenate([[0], np.cumsum(spoken)])  # (n + 1,) frames with sound before each
    sizes = np.cumsum([0.0, *(_size(word) for word in texts)])
    shares = _at_pauses(texts, sizes / sizes[-1] * voiced[-1], spoken, voiced)
    starts = np.searchsorted(voiced, np.floor(shares[:-1] + 1e-9), side="right") - 1
    ends = np.searchsorted(voiced, np.floor(shares[1:] + 1e-9), side="left")
    return tuple(
        Word(word, begin + FRAME * float(a), begin + FRAME * float(b))
        for word, a, b in zip(texts, starts, ends, strict=True)
    )


def unknown_words(levels: Array) -> tuple[Word, ...]:
    """Words of speech whose text is unknown: stretches of sound of about a word's duration.

    Args:
        levels: (n,) loudness of the whole utterance, dB.
    """
    voiced = int((levels > levels.max(initial=_FLOOR) - SPOKEN).sum()) * FRAME
    count = round(voiced / _WORD)
    return timed_words(" ".join([UNKNOWN] * count), levels, 0.0, len(levels) * FRAME)


def _at_pauses(texts: list[str], shares: Array, spoken: np.ndarray, voiced: np.ndarray) -> Array:
    """Moves ends of words to pauses.

    Args:
        texts: The N words.
        shares: (N + 1,) estimated ends of the words, counted in frames with sound.
        spoken: (n,) bool: frames with sound.
        voiced: (n + 1,) number of frames with sound before each frame.

    Returns:
        (N + 1,) ends, of which those near a pause are at the pause.
    """
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
    """For each pause within the speech, the number of frames with sound before it."""
    ends = np.flatnonzero(np.diff(np.concatenate([[1], spoken, [1]]).astype(int)))
    runs = ends.reshape(-1, 2)
    return [
        float(voiced[a])
        for a, b in runs
        if (b - a) * FRAME >= _PAUSE and 0 < voiced[a] < voiced[-1]
    ]


def _size(word: str) -> float:
    """Duration of a word relative to other words, estimated from syllables and letters."""
    if word.strip(".,;:!?").isdigit():
        return 2.0 * len(word)
    return 1.0 * max(1, len(_VOWELS.findall(word.lower()))) + 0.25 * len(word)


def accents(words: tuple[Word, ...], levels: Array, ended: bool) -> tuple[Accent, ...]:
    """The stressed syllable of each word whose sound is known.

    It is at the highest peak of the smoothed loudness within the word; a word without a peak has
    none. Further sound does not change what was found before.

    Args:
        words: Words in order of time.
        levels: (n,) loudness known so far, dB.
        ended: Whether the utterance has ended, so that no more sound follows.
    """
    return GrowingAccents().up_to(words, levels, ended)


class GrowingAccents:
    """Accents of speech that grows: each word is looked at once, however often somebody asks."""

    def __init__(self):
        """Starts before the first word."""
        self._found: list[Accent] = []
        self._next = 0  # the first word that is not looked at yet

    def up_to(self, words: tuple[Word, ...], levels: Array, ended: bool) -> tuple[Accent, ...]:
        """All accents known so far, as `accents` finds them.

        Args:
            words: Words in order of time; those of the call before come first.
            levels: (n,) loudness known so far, dB; that of the call before comes first.
            ended: Whether the utterance has ended, so that no more sound follows.
        """
        if self._next < len(words) and len(levels):
            earliest = words[self._next].begin - _LEANING - _MEMORY - 3 * _SMOOTH
            begin = max(int(earliest / FRAME) - 2, 0)
            peaks = _Peaks(levels[begin:], begin)
            known = len(levels) * FRAME - (0.0 if ended else SETTLED)
            for number in range(self._next, len(words)):
                if words[number].end + _LEANING > known and not ended:
                    break
                self._next = number + 1
                after = self._found[-1].time if self._found else -np.inf
                self._found += peaks.accent(words[number], number, after)
        return tuple(self._found)


class _Peaks:
    """Peaks of loudness from a frame on; what lies near the first one may be wrong."""

    def __init__(self, levels: Array, begin: int):
        """Finds the peaks of levels (n,), of which the first one belongs to the frame `begin`."""
        self._begin = begin
        self._smooth = smoothed(levels)
        self._loudest = _recent_loudest(self._smooth)
        rises = np.diff(self._smooth, prepend=_FLOOR) > 0
        falls = np.diff(self._smooth, append=_FLOOR) <= 0
        self._at = rises & falls & (self._smooth > self._loudest - SPOKEN)

    def accent(self, word: Word, number: int, after: float) -> list[Accent]:
        """The accent of a word, if it has one after a moment."""
        first = max(round((word.begin - _LEANING) / FRAME) - self._begin, 0)
        last = min(round((word.end + _LEANING) / FRAME) - self._begin, len(self._at) - 1)
        inside = first + np.flatnonzero(self._at[first : last + 1])
        if not len(inside):
            return []
        best = int(inside[np.argmax(self._smooth[inside])])
        time = (self._begin + best) * FRAME
        strength = float(self._smooth[best] - self._loudest[best])
        return [Accent(time, strength, number)] if time > after else []
