"""Speech synthesis with espeak-ng, which also tells the time of every phoneme.

Training uses the phonemes as ground truth; without a network, espeak-ng can serve as a voice. The
library (GPL-3) comes with the package `espeakng-loader` and is loaded at first use.
"""

# pyright: reportMissingTypeStubs=false
# (espeakng_loader is untyped)

import _ctypes
import contextlib
import ctypes
import os
import shutil
import tempfile
import threading
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.errors import MissingExtraError, SettingsError

_SYNCHRONOUS = 2
_OPTIONS = 0x1 | 0x2 | 0x8000  # phoneme events, in IPA, errors do not end the process
_UTF8 = 1
_BLOCK_MS = 500  # longer blocks, fewer calls back
_RATE, _PITCH, _RANGE = 1, 3, 4  # numbers of espeak-ng's parameters
_PHONEME = 7  # event type; 0 ends a list of events

_LOCK = threading.Lock()  # espeak-ng sets the process's locale while it starts

_unload = _ctypes.FreeLibrary if os.name == "nt" else _ctypes.dlclose

_VOICELESS_STOPS = ("p", "t", "k", "q", "c", "ʈ")
_STEP = 0.005  # s, resolution of the search for a closure
_MAX_CLOSURE = 0.12  # s
_QUIET = 0.06  # of the sound before: quieter than this, a voiceless stop is closed


class _Event(ctypes.Structure):
    """`espeak_EVENT` of speak_lib.h."""

    _fields_ = (
        ("type", ctypes.c_int),
        ("identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("id", ctypes.c_char * 8),
    )


_Callback = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.POINTER(_Event)
)


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


@contextlib.contextmanager
def _library() -> Generator[tuple[ctypes.CDLL, int], None, None]:
    """A fresh instance of the library and its sample rate.

    espeak-ng carries phases from one utterance into the next, so that the same text sounds
    different each time. A private copy of its file per call (1 ms) starts from the same state.
    """
    try:
        import espeakng_loader
    except ImportError:
        raise MissingExtraError("espeakng-loader", "voice", "the espeak-ng voice") from None
    source = Path(espeakng_loader.get_library_path())
    data = str(espeakng_loader.get_data_path()).encode()
    with tempfile.TemporaryDirectory(prefix="ico3d-") as folder:
        try:
            library = ctypes.CDLL(shutil.copy(source, folder))
        except OSError as error:
            raise SettingsError(
                f"espeak-ng cannot be loaded from a temporary folder ({error}): "
                "name one that allows it in the environment variable TMPDIR."
            ) from None
        try:
            rate = library.espeak_Initialize(_SYNCHRONOUS, _BLOCK_MS, data, _OPTIONS)
            if rate <= 0:
                raise SettingsError(f"espeak-ng cannot read its data in {data.decode()}.")
            yield library, rate
        finally:
            library.espeak_Terminate()
            _unload(library._handle)


def synthesize(
    text: str, voice: str = "en-us", rate: int = 170, pitch: int = 50, pitch_range: int = 50
) -> Speech:
    """Speaks a text; the same arguments give the same samples.

    Any thread may call this function; a lock lets one call at a time through.

    Args:
        text: What to say, in the language of the voice.
        voice: Language and, after `+`, a variant: `en-us`, `de+f3`, `fr+klatt2`.
        rate: Words per minute, 80 to 450.
        pitch: Pitch of the voice, 0 to 100.
        pitch_range: How far the pitch moves: 0 (monotone) to 100.

    Raises:
        MissingExtraError: If espeakng-loader is not installed.
        SettingsError: If espeak-ng has no such voice.
    """
    blocks: list[np.ndarray] = []
    marks: list[tuple[int, str]] = []

    def receive(samples: Any, count: int, events: Any) -> int:
        if count > 0:
            blocks.append(np.ctypeslib.as_array(samples, (count,)).copy())
        marks.extend(_phoneme_marks(events))
        return 0

    with _LOCK, _library() as (library, sample_rate):
        if library.espeak_SetVoiceByName(voice.encode()) != 0:
            raise SettingsError(f"espeak-ng has no voice '{voice}': try 'en-us' or 'en-us+f3'.")
        for parameter, value in ((_RATE, rate), (_PITCH, pitch), (_RANGE, pitch_range)):
            library.espeak_SetParameter(parameter, value, 0)
        library.espeak_ng_SetRandSeed(ctypes.c_long(1))
        callback = _Callback(receive)
        library.espeak_SetSynthCallback(callback)
        data = text.replace("\0", " ").encode()
        library.espeak_Synth(data, ctypes.c_size_t(len(data) + 1), 0, 0, 0, _UTF8, None, None)
    pcm = np.concatenate(blocks) if blocks else np.zeros(0, np.int16)  # (S,)
    samples = pcm.astype(np.float32) / 32768
    return Speech(samples, sample_rate, _timed(marks, samples, sample_rate))


def _phoneme_marks(events: Any) -> list[tuple[int, str]]:
    """(sample, symbol) of the phonemes in one block's list of events."""
    marks: list[tuple[int, str]] = []
    index = 0
    while events[index].type:
        if events[index].type == _PHONEME:
            address = ctypes.addressof(events[index]) + _Event.id.offset
            symbol = ctypes.string_at(address, 8).split(b"\0")[0].decode("utf-8", "ignore")
            if not symbol.startswith("("):  # "(en)" tells a change of language
                marks.append((events[index].sample, symbol))
        index += 1
    return marks


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
