"""Hibari: a small American English voice, female, whose model lies in its Python package.

The model was distilled from Kokoro's voice `af_heart`; package and model are licensed under
Apache-2.0. A second of speech takes about 10 ms on one core.
"""

import functools
import hashlib
import threading
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ico3d.chat.services.provider import Context, lacks_package
from ico3d.chat.services.voice.base import LOADING, PieceVoice, Spoken, at_speech_rate
from ico3d.chat.services.voice.phonemes import timed
from ico3d.errors import MissingExtraError, SettingsError

SHA256 = "5f70741d4e900f4e85d0037498736cc1b3e1b9a63a13546a5da1e63abf4fccd8"
"""SHA-256 of the model that the package carries."""
DURATIONS = "/Clip_output_0"
"""Name of the tensor in the model that holds how long each symbol lasts."""
DIPHTHONGS = {"A": "eɪ", "I": "aɪ", "O": "oʊ", "W": "aʊ", "Y": "ɔɪ", "ʤ": "dʒ", "ʧ": "tʃ", "ᵊ": "ə"}
"""IPA of the symbols in which Kokoro's alphabet differs."""
EARLY = 0.06  # s by which sounds come before their durations say, as in Kokoro; measured
GAIN = 1.6  # 4 dB, after which it is about as loud as the other voices
LEAD = 0.05  # s of the silence before a sentence that are kept; the model makes 0.3


@dataclass(frozen=True)
class Settings:
    """Options of the voice `hibari`, which speaks English only.

    Attributes:
        speed: Speed as a factor of the voice's own, 0.5 to 2.
    """

    speed: float = 1.0

    def __post_init__(self):
        """Checks the speed.

        Raises:
            SettingsError: If the voice cannot speak at it.
        """
        if not 0.5 <= self.speed <= 2:
            raise SettingsError("chat settings: voice 'hibari': speed must be 0.5 to 2.")


def hindrance(settings: Settings) -> str:
    """A sentence on a missing package; empty if the voice works."""
    return lacks_package("hibari", "natural")


def make(settings: Settings, context: Context) -> PieceVoice:
    """Creates the voice of one session; all sessions share one model.

    Raises:
        MissingExtraError: If hibari-tts is not installed.
        SettingsError: If the package carries another model than the one that was tested.
    """
    if hindrance(settings):
        raise MissingExtraError("hibari-tts", "natural", "the voice Hibari")
    with LOADING:
        engine = load()
    return PieceVoice("heart", partial(engine.speak, speed=settings.speed))


@functools.cache
def load() -> "Engine":
    """Loads the model, once per process.

    Raises:
        SettingsError: If the package carries another model than the one that was tested.
    """
    from hibari import Hibari

    return Engine(Hibari())


class Engine:
    """The voice, and the durations of its symbols, which its package keeps to itself."""

    def __init__(self, voice: Any):
        """Opens the model of a `hibari.Hibari` once more, with one output in addition.

        Raises:
            SettingsError: If it is another model than the one that was tested.
        """
        import onnxruntime

        model = Path(voice.model_path).read_bytes()
        if hashlib.sha256(model).hexdigest() != SHA256:
            raise SettingsError("the voice in the package hibari-tts is not the one that is known.")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(with_output(model, DURATIONS), options)
        self._voice, self._lock = voice, threading.Lock()
        self.speak("Ready.")  # what is loaded at first use

    def speak(self, text: str, speed: float = 1.0) -> Spoken:
        """Speaks a text; the same text sounds the same."""
        pieces: list[np.ndarray] = []
        symbols: list[tuple[str, float]] = []
        with self._lock:  # the dictionary keeps words that it has looked up
            written = self._voice.phonemize(text)
        for phonemes in written:
            known = [symbol for symbol in phonemes if symbol in self._voice.vocab]
            sound, seconds = self._sound(self._voice.ids(known), speed)
            pieces.append(sound)
            ipa = ["_", *(DIPHTHONGS.get(symbol, symbol) for symbol in known), "_"]
            symbols += zip(ipa, seconds, strict=True)
        sound = np.concatenate([*pieces, np.zeros(0, np.float32)])
        return Spoken(at_speech_rate(sound, self._voice.sample_rate), timed(symbols))

    def _sound(self, ids: list[int], speed: float) -> tuple[np.ndarray, list[float]]:
        """The sound of a sentence, (S,) float32, and the seconds that each symbol takes."""
        from hibari import dsp

        given = {"ids": np.asarray([ids], np.int64), "speed": np.asarray([speed], np.float32)}
        given_back: list[Any] = list(self._session.run(None, given))
        *parts, durations = given_back
        spectrum = [part[0] for part in parts]  # of the one sentence in the batch
        sound: np.ndarray = dsp.synth(*spectrum, rng=np.random.default_rng(0))  # (S,)
        share = durations.ravel() / durations.sum()  # (L,)
        seconds = share * len(sound) / self._voice.sample_rate  # (L,)
        late = max(0, round((seconds[0] - EARLY - LEAD) * self._voice.sample_rate))
        seconds[0] -= late / self._voice.sample_rate + EARLY
        seconds[-1] += EARLY
        return GAIN * sound[late:], seconds.tolist()


def with_output(model: bytes, tensor: str) -> bytes:
    """An ONNX model that also gives one of its inner tensors, as its last output.

    Two protocol buffers behind each other are one with the fields of both, lists joined, so that a
    second `graph` with nothing but one `output` adds that output to the first.

    Args:
        model: The model's file.
        tensor: Name of the tensor.
    """
    graph, output, name = 7, 12, 1  # numbers of the fields in onnx.proto
    return model + _field(graph, _field(output, _field(name, tensor.encode())))


def _field(number: int, value: bytes) -> bytes:
    """A field of a protocol buffer; numbers and lengths below 128."""
    return bytes([number << 3 | 2, len(value)]) + value
