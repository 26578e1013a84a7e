"""Frames that only this pipeline has: messages of the page, and sound with its face."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from pipecat.frames.frames import DataFrame, Frame, InputAudioRawFrame, SystemFrame

from ico3d.chat.wire.protocol import SPEECH_RATE, ClientMessage
from ico3d.common.espeak.speech import Phoneme

Message = TypeVar("Message")


@dataclass
class SpeechFrame(DataFrame):
    """100 to 200 ms of sound with the matching face, in one frame so that both stay in step.

    Parameters:
        utterance: Number of the answer.
        first_sample: Index of the first sample in the utterance, at 24 kHz.
        first_expression: Index of the first row of expressions in the utterance.
        pcm: (n,) int16 at 24 kHz.
        expressions: (rows, B) float32.
        text: The sentence that starts with this piece, or None.
        ends_sentence: Whether this is the last piece of its sentence.
    """

    utterance: int
    first_sample: int
    first_expression: int
    pcm: np.ndarray
    expressions: np.ndarray
    text: str | None = None
    ends_sentence: bool = False


@dataclass
class PhonemesFrame(DataFrame):
    """The speech sounds of a stretch of speech; comes before the stretch's first sound.

    Parameters:
        phonemes: The speech sounds in the order of time; each lasts until the next one begins.
            Their times count from the first sample of the stretch.
        seconds: Duration of the stretch.
        context_id: pipecat's name of the answer that the stretch belongs to.
    """

    phonemes: tuple[Phoneme, ...]
    seconds: float
    context_id: str | None = None


@dataclass
class UtteranceEndFrame(DataFrame):
    """All sound of an utterance has been synthesised.

    Parameters:
        utterance: Number of the answer.
        samples: Length of the utterance's sound at 24 kHz.
    """

    utterance: int
    samples: int


@dataclass
class MicrophoneFrame(InputAudioRawFrame):
    """Sound from the microphone, and what the page played when its last sample was recorded.

    Parameters:
        playing: Number of the utterance that was playing; None in silence.
        position: Seconds of that utterance that had been heard.
    """

    playing: int | None = None
    position: float = 0.0


@dataclass
class VoiceFrame(SystemFrame):
    """A quick judgement of the last 20-100 ms of sound, long before the VAD is sure.

    Parameters:
        at: Seconds of sound that the microphone had sent before.
        seconds: Duration of this sound.
        voiced: Whether the sound contains a voice.
        plain: Whether the voice has been a single, unchanging vowel or hum so far.
        fading: Whether the voice is much quieter than before, as at the end of a word.
        silence: Seconds for which the voice has been silent although the VAD has not ended it.
    """

    at: float = 0.0
    seconds: float = 0.0
    voiced: bool = False
    plain: bool = False
    fading: bool = False
    silence: float = 0.0


@dataclass
class PageFrame(SystemFrame):
    """A message from the page on its way to the processor that acts on it.

    Parameters:
        message: The page's message; `message_in` returns it by type.
    """

    message: ClientMessage


def message_in(frame: Frame, kind: type[Message]) -> Message | None:
    """The message of a `PageFrame` if it has the type `kind`; None for every other frame."""
    carried = frame.message if isinstance(frame, PageFrame) else None
    return carried if isinstance(carried, kind) else None


@dataclass
class TypedFrame(SystemFrame):
    """A typed question; it follows the interruption frame that it causes.

    Parameters:
        text: The question.
    """

    text: str = ""


class Utterances:
    """Numbers the answers of a session; knows their lengths and which ones were stopped."""

    def __init__(self):
        """Starts without answers."""
        self.last = -1
        self._stopped_through = -1
        self._sound: dict[int, tuple[float, bool]] = {}

    def begin(self) -> int:
        """Returns the number of a new answer."""
        self.last += 1
        return self.last

    def made(self, utterance: int, samples: int, complete: bool = False) -> None:
        """Registers how much of an answer has been synthesised: samples, and whether all."""
        self._sound = {n: sound for n, sound in self._sound.items() if n > self._stopped_through}
        self._sound[utterance] = samples / SPEECH_RATE, complete

    def sound(self, utterance: int) -> tuple[float, bool]:
        """Seconds of an answer that have been synthesised, and whether these are all."""
        return self._sound.get(utterance, (0.0, False))

    def stop_all(self) -> None:
        """Marks all answers so far as stopped."""
        self._stopped_through = self.last

    def is_stopped(self, utterance: int) -> bool:
        """Whether an answer was stopped, so that further pieces of it must be dropped."""
        return utterance <= self._stopped_through
