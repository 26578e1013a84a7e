"""espeak-ng in a process of its own.

The library is written in C and reads what anybody says: a text of 160 letters makes some versions
write beyond a buffer, which ends the process. So that is another one than that of the server.
"""

# pyright: reportMissingTypeStubs=false
# (espeakng_loader is untyped)

import _ctypes
import contextlib
import ctypes
import os
import re
import shutil
import tempfile
from collections.abc import Generator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ico3d.common.native.isolated import Isolated, RefusedError, Told, serve

_SYNCHRONOUS = 2
_OPTIONS = 0x1 | 0x2 | 0x8000  # phoneme events, in IPA, errors do not end the process
_UTF8 = 1
_BLOCK_MS = 500  # longer blocks, fewer calls back
_RATE, _PITCH, _RANGE = 1, 3, 4  # numbers of espeak-ng's parameters
_PHONEME = 7  # event type; 0 ends a list of events

LONGEST = 60.0  # s that a text may take on a machine that is busy with other things

NEEDED = ("libstdc++.so.6", "libm.so.6", "libgcc_s.so.1")
"""What the library needs on Linux, and would look for where its wheel was built, below /home."""

_VOICE = re.compile(r"[A-Za-z0-9_-]+(\+[A-Za-z0-9_-]+)?")
"""Names of voices; a path would be that of any file, which the library would parse."""

_unload = _ctypes.FreeLibrary if os.name == "nt" else _ctypes.dlclose


@dataclass(frozen=True)
class Request:
    """What to say, and how; see `ico3d.common.espeak.speech.synthesize`."""

    text: str
    voice: str
    rate: int
    pitch: int
    pitch_range: int


@dataclass(frozen=True)
class Answer:
    """A spoken text.

    Attributes:
        rate: Samples per second.
        marks: Sample at which each phoneme begins, and its symbol.
        pcm: 16-bit samples, mono.
    """

    rate: int
    marks: list[tuple[int, str]]
    pcm: bytes


process = Isolated("ico3d.common.espeak.process", LONGEST)
"""That of this process."""


def ask(request: Request) -> Answer:
    """Speaks a text.

    Raises:
        RefusedError: If it cannot be spoken so.
        LostError: If the process has ended, or took too long.
    """
    about, pcm = process.ask(asdict(request))
    marks = [(sample, symbol) for sample, symbol in about["marks"]]
    return Answer(about["rate"], marks, pcm)


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


@contextlib.contextmanager
def _library() -> Generator[tuple[ctypes.CDLL, int], None, None]:
    """A fresh instance of the library and its sample rate.

    espeak-ng carries phases from one utterance into the next, so that the same text sounds
    different each time. A private copy of its file per call (1 ms) starts from the same state.
    """
    import espeakng_loader

    for name in NEEDED:  # what is loaded already is not looked for
        with contextlib.suppress(OSError):
            ctypes.CDLL(name)
    source = Path(espeakng_loader.get_library_path())
    data = str(espeakng_loader.get_data_path()).encode()
    with tempfile.TemporaryDirectory(prefix="ico3d-") as folder:
        try:
            library = ctypes.CDLL(shutil.copy(source, folder))
        except OSError as error:
            raise RefusedError(
                f"espeak-ng cannot be loaded from a temporary folder ({error}): "
                "name one that allows it in the environment variable TMPDIR."
            ) from None
        try:
            rate = library.espeak_Initialize(_SYNCHRONOUS, _BLOCK_MS, data, _OPTIONS)
            if rate <= 0:
                raise RefusedError(f"espeak-ng cannot read its data in {data.decode()}.")
            yield library, rate
        finally:
            library.espeak_Terminate()
            _unload(library._handle)


def speak(request: Request) -> Answer:
    """Speaks a text in this process, which may end by it.

    Raises:
        RefusedError: If it cannot be spoken so.
    """
    blocks: list[bytes] = []
    marks: list[tuple[int, str]] = []

    def receive(samples: Any, count: int, events: Any) -> int:
        if count > 0:
            blocks.append(ctypes.string_at(samples, 2 * count))
        marks.extend(_phoneme_marks(events))
        return 0

    with _library() as (library, rate):
        known = _VOICE.fullmatch(request.voice) is not None
        if not known or library.espeak_SetVoiceByName(request.voice.encode()) != 0:
            raise RefusedError(
                f"espeak-ng has no voice '{request.voice}': try 'en-us' or 'en-us+f3'."
            )
        settings = (_RATE, request.rate), (_PITCH, request.pitch), (_RANGE, request.pitch_range)
        for parameter, value in settings:
            library.espeak_SetParameter(parameter, value, 0)
        library.espeak_ng_SetRandSeed(ctypes.c_long(1))
        callback = _Callback(receive)
        library.espeak_SetSynthCallback(callback)
        data = request.text.replace("\0", " ").encode()
        library.espeak_Synth(data, ctypes.c_size_t(len(data) + 1), 0, 0, 0, _UTF8, None, None)
    return Answer(rate, marks, b"".join(blocks))


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


def _answer(request: dict[str, Any]) -> Told:
    answer = speak(Request(**request))
    return {"rate": answer.rate, "marks": answer.marks}, answer.pcm


if __name__ == "__main__":
    serve(_answer)
