"""espeak-ng in a process of its own.

The library is written in C and reads what anybody says: a text of 160 letters makes some versions
write beyond a buffer, which ends the process. So that is another one than that of the server. Its
main loop is `serve`; nothing that is slow to import is imported here.
"""

# pyright: reportMissingTypeStubs=false
# (espeakng_loader is untyped)

import _ctypes
import atexit
import contextlib
import ctypes
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO

_SYNCHRONOUS = 2
_OPTIONS = 0x1 | 0x2 | 0x8000  # phoneme events, in IPA, errors do not end the process
_UTF8 = 1
_BLOCK_MS = 500  # longer blocks, fewer calls back
_RATE, _PITCH, _RANGE = 1, 3, 4  # numbers of espeak-ng's parameters
_PHONEME = 7  # event type; 0 ends a list of events

_LENGTH = struct.Struct("<I")
_ANSWER = struct.Struct("<II")
LONGEST = 60.0  # s that a text may take on a machine that is busy with other things

_unload = _ctypes.FreeLibrary if os.name == "nt" else _ctypes.dlclose


class SpeakerLostError(Exception):
    """The process has ended in the middle of a text; the next call starts a new one."""


class RefusedError(Exception):
    """espeak-ng cannot speak so; the message is a sentence that says why."""


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


class EspeakProcess:
    """The process, for which threads wait in turn."""

    def __init__(self):
        """Starts no process yet; the first call does."""
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = ""  # where it keeps copies of the library, which it may leave behind
        self._lock = threading.Lock()

    def ask(self, request: Request) -> Answer:
        """Speaks a text.

        Raises:
            RefusedError: If it cannot be spoken so.
            SpeakerLostError: If the process has ended, or took too long.
        """
        with self._lock:
            if self._process is None:
                self._folder = tempfile.mkdtemp(prefix="ico3d-")
                self._process = subprocess.Popen(
                    # -P: nothing is imported from the folder in which somebody starts the server
                    (sys.executable, "-P", "-m", __name__, self._folder),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                )
            late = threading.Timer(LONGEST, self._process.kill)
            late.daemon = True
            late.start()
            try:
                answered = self._exchange(self._process, request)
            except (OSError, EOFError):
                self.close()
                raise SpeakerLostError from None
            except BaseException:  # whoever stops in the middle leaves half an answer behind
                self.close()
                raise
            finally:
                late.cancel()
        if isinstance(answered, str):
            raise RefusedError(answered)
        return answered

    def close(self) -> None:
        """Ends the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            _close(process)
            shutil.rmtree(self._folder, ignore_errors=True)

    def forget(self) -> None:
        """Leaves the process to whoever started it: it is that of a parent of this process."""
        process, self._process = self._process, None
        self._lock = threading.Lock()  # a thread that is not here may have held it
        if process is not None:
            _close(process)
            process.returncode = 0  # not to be waited for

    def _exchange(self, process: "subprocess.Popen[bytes]", request: Request) -> Answer | str:
        """The answer, or a sentence that says why there is none."""
        to, back = process.stdin, process.stdout
        assert to is not None and back is not None
        data = json.dumps(asdict(request)).encode()
        to.write(_LENGTH.pack(len(data)) + data)
        to.flush()
        told, sound = _ANSWER.unpack(_read(back, _ANSWER.size))
        about = json.loads(_read(back, told))
        pcm = _read(back, sound)
        if "error" in about:
            return str(about["error"])
        return Answer(about["rate"], [(sample, symbol) for sample, symbol in about["marks"]], pcm)


def _close(process: "subprocess.Popen[bytes]") -> None:
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        with contextlib.suppress(OSError):  # what was not sent any more
            pipe.close()


def _read(pipe: Any, count: int) -> bytes:
    data = pipe.read(count)
    if len(data) < count:
        raise EOFError
    return data


process = EspeakProcess()
"""That of this process."""
atexit.register(process.close)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=process.forget)


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
        if library.espeak_SetVoiceByName(request.voice.encode()) != 0:
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


def serve(asked: BinaryIO, told: BinaryIO) -> None:
    """Main loop of the process: reads requests from `asked`, writes answers to `told`."""
    while header := asked.read(_LENGTH.size):
        (length,) = _LENGTH.unpack(header)
        try:
            answer = speak(Request(**json.loads(asked.read(length))))
            about, pcm = {"rate": answer.rate, "marks": answer.marks}, answer.pcm
        except RefusedError as error:
            about, pcm = {"error": str(error)}, b""
        data = json.dumps(about).encode()
        told.write(_ANSWER.pack(len(data), len(pcm)) + data + pcm)
        told.flush()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it ends it
    tempfile.tempdir = sys.argv[1]
    serve(sys.stdin.buffer, sys.stdout.buffer)
