"""Whisper on a CPU that encodes what was said, not the silence up to thirty seconds behind it.

Whisper was trained on windows of thirty seconds, and faster-whisper fills each window with zeros,
which mean a loud hum in its spectrograms. A visitor speaks for a few seconds, and the encoder is
most of the work. Windows of less than ten seconds, the hum, and tokens of time lead the model into
loops (docs/benchmarks.md); what looks like one is transcribed once more from a whole window.
"""

import re
from collections.abc import Iterable, Sequence
from contextvars import ContextVar
from typing import Any

import numpy as np
from faster_whisper import WhisperModel

FRAMES = 100  # of the spectrogram in a second
SHORTEST = 10 * FRAMES  # of a window
MARGIN = 2 * FRAMES  # that stay behind the sound, from which the model knows that it has ended
MOST_REPETITIVE, LEAST_LIKELY = 2.4, -1.0  # Whisper's own limits: compression, mean log-probability
_TWICE = re.compile(r"\b((?:[\w'’]+\W+){2,}[\w'’]+)\W+\1", re.IGNORECASE)
"""Three words or more that are said twice in a row."""
_whole: ContextVar[bool] = ContextVar("whole", default=False)


class ShortWhisper(WhisperModel):
    """A Whisper model for short windows."""

    def transcribe(self, *sound: Any, **options: Any) -> tuple[Iterable[Any], Any]:
        """Transcribes sound, (S,) float32 at 16 kHz; the segments have all been decoded."""
        options = {"without_timestamps": True, **options}
        segments, about = super().transcribe(*sound, **options)
        found = list(segments)
        if not is_doubtful(found):
            return found, about
        token = _whole.set(True)
        try:
            segments, about = super().transcribe(*sound, **options)
            return list(segments), about
        finally:
            _whole.reset(token)

    def encode(self, features: np.ndarray) -> Any:
        """Encodes a window without most of its filling.

        Args:
            features: Spectrogram of a window, (F, T) or (1, F, T), filled with zeros.
        """
        return super().encode(features if _whole.get() else shortened(features))


def shortened(features: np.ndarray) -> np.ndarray:
    """A window (..., F, T) without most of its filling; what stays of it becomes silence."""
    window = features[..., : needed(features)].copy()
    filling = ~window.reshape(-1, window.shape[-1]).any(axis=0)  # (T,)
    window[..., filling] = window[..., ~filling].min(initial=0.0)
    return window


def needed(features: np.ndarray) -> int:
    """How many frames of a window (..., T) are encoded."""
    filled = features.reshape(-1, features.shape[-1]).any(axis=0)  # (T,)
    last = int(np.flatnonzero(filled)[-1]) + 1 if filled.any() else 0
    return min(features.shape[-1], max(SHORTEST, last + MARGIN))


def is_doubtful(segments: Sequence[Any]) -> bool:
    """Whether a transcript looks like a loop, or like a guess."""
    text = " ".join(segment.text for segment in segments)
    return _TWICE.search(text) is not None or any(
        segment.compression_ratio > MOST_REPETITIVE or segment.avg_logprob < LEAST_LIKELY
        for segment in segments
    )
