"""Frames that only this pipeline has: what comes from the page, and sound with its face."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from pipecat.frames.frames import DataFrame, Frame, InputAudioRawFrame, SystemFrame

from ico3d.chat.wire.protocol import SPEECH_RATE, ClientMessage

Message = TypeVar("Message")


@dataclass
class SpeechFrame(DataFrame):
    """100-200 ms of sound with the face that belongs to it: one thing, so it cannot drift.

    Parameters:
        utterance: Which answer.
        first_sample: Of the utterance, at 24 kHz.
        first_expression: Index of the first row.
        pcm: (n,) int16.
        expressions: (rows, B) float32.
        text: The sentence that starts with this piece, if one does.
    """

    utterance: int
    first_sample: int
    first_expression: int
    pcm: np.ndarray
    expressions: np.ndarray
    text: str | None = None


@dataclass
class UtteranceEndFrame(DataFrame):
    """All sound of an utterance has been made.

    Parameters:
        utterance: Which answer.
        samples: Length of its sound at 24 kHz.
    """

    utterance: int
    samples: int


@dataclass
class MicrophoneFrame(InputAudioRawFrame):
    """Sound from the microphone, and what the page played when its last sample was recorded.

    Parameters:
        playing: The utterance; None in silence.
        position: Seconds of it that had been heard.
    """

    playing: int | None = None
    position: float = 0.0


@dataclass
class VoiceFrame(SystemFrame):
    """What the last 20-100 ms from the microphone were; long before the VAD is sure.

    Parameters:
        at: Seconds that the microphone had sent before.
        seconds: How long this is.
        voiced: Whether there is a voice in them.
        plain: Whether all of the voice so far was one and the same vowel or hum.
        fading: Whether it is much quieter than it was, as at the end of a word.
        silence: Seconds for which the VAD, which still knows of a voice, has not heard it.
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
        message: What the page sent; `message_in` takes it out.
    """

    message: ClientMessage


def message_in(frame: Frame, kind: type[Message]) -> Message | None:
    """The message of a `PageFrame` if it is of a certain kind; None for every other frame."""
    carried = frame.message if isinstance(frame, PageFrame) else None
    return carried if isinstance(carried, kind) else None


@dataclass
class TypedFrame(SystemFrame):
    """A typed question, behind the interruption that it is.

    Parameters:
        text: What was typed.
    """

    text: str = ""


class Utterances:
    """Numbers the answers of a session; knows how long they are and which were stopped."""

    def __init__(self):
        """None yet."""
        self.last = -1
        self._stopped_through = -1
        self._sound: dict[int, tuple[float, bool]] = {}

    def begin(self) -> int:
        """The number of a new answer."""
        self.last += 1
        return self.last

    def made(self, utterance: int, samples: int, complete: bool = False) -> None:
        """So many samples of an answer have been made, sent or not; all of them if complete."""
        self._sound = {n: sound for n, sound in self._sound.items() if n > self._stopped_through}
        self._sound[utterance] = samples / SPEECH_RATE, complete

    def sound(self, utterance: int) -> tuple[float, bool]:
        """Seconds of an answer that have been made, and whether that is all of it."""
        return self._sound.get(utterance, (0.0, False))

    def stop_all(self) -> None:
        """Everything begun so far is over."""
        self._stopped_through = self.last

    def is_stopped(self, utterance: int) -> bool:
        """Whether pieces of an answer that still arrive are to be dropped."""
        return utterance <= self._stopped_through
