"""The protocol between page and server: all messages, and the limits.

The annotations in this file are the only definition. `codec.py` encodes, decodes and checks by
them, and `python -m ico3d.chat.generating` generates `viewer/src/protocol.ts` and
`docs/protocol.md`.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np

from ico3d.chat.wire.marks import (
    Count,
    Length,
    Milliseconds,
    Name,
    Seconds,
    Tensor,
    Words,
)
from ico3d.chat.wire.protocol_gestures import MAX_CUES, Cue, Release
from ico3d.chat.wire.protocol_services import Dictation, Offer, Service, Services
from ico3d.chat.wire.protocol_visits import Error, Hello, Notes, Notice, Place, Welcome

VERSION = 9
MICROPHONE_RATE = 16_000  # Hz, PCM16 mono from the page
MICROPHONE_CHUNK = 512  # samples of a message: what Silero judges at once, so that none waits
SPEECH_RATE = 24_000  # Hz, PCM16 mono to the page
EXPRESSION_FPS = 25  # rows per second of an utterance's sound
MAX_TEXT_FRAME = 16 * 1024  # bytes
MAX_BINARY_FRAME = 64 * 1024  # bytes
MAX_RATE = 100  # messages per second a client may send for long
MAX_BURST = 200  # messages it may send at once
RESUME_SECONDS = 30  # how long a session waits for its page to come back
BEAT_SECONDS = 1.0  # after which a line that carries nothing else carries a beat
MAX_AHEAD_SECONDS = 2.0  # how far speech may run ahead of its playback
MAX_QUESTION = 2000  # characters of a question, however it is asked
MAX_ARGUMENTS = 4000  # characters of a function's arguments
MAX_POINTS = 500  # of a timeline in one message
MAX_WORDS = 500  # of a sentence that are timed


@dataclass(frozen=True, eq=False)
class Audio:
    """Sound from the microphone (binary).

    Attributes:
        sample: Index of the first sample since the microphone was opened; a jump means that the
            page left out sound that the network could not carry.
        pcm: (n,) int16 at 16 kHz, at most 1 s; 20-100 ms are best.
        playing: Utterance that the loudspeaker was playing when the last sample was recorded; null
            in silence.
        position: Seconds of the utterance `playing` that had been heard by then; 0 in silence.
    """

    sample: Count
    pcm: Annotated[np.ndarray, Tensor("<i2", 1, MICROPHONE_RATE)]
    playing: Count | None = None
    position: Seconds = 0.0


@dataclass(frozen=True)
class Text:
    """A typed question.

    Attributes:
        text: The question.
    """

    text: Annotated[str, Length(1, MAX_QUESTION)]


@dataclass(frozen=True)
class Say:
    """A text that the avatar is to say as it is, instead of what it was saying.

    Servers refuse it unless their settings allow it (`say` in `[embedding]`).

    Attributes:
        text: The text.
    """

    text: Annotated[str, Length(1, MAX_QUESTION)]


@dataclass(frozen=True)
class Interrupt:
    """The visitor asks the avatar to be silent.

    Attributes:
        utterance: The utterance to stop; null for the current one.
    """

    utterance: Count | None


@dataclass(frozen=True)
class Clock:
    """Position of playback; sent every 100-250 ms during playback, and once at the very end.

    Attributes:
        utterance: The utterance that is playing.
        position: Seconds of the utterance that have been heard (output latency included).
        body_time: Body time in seconds; 0 without a body.
    """

    utterance: Count
    position: Seconds
    body_time: Seconds


@dataclass(frozen=True)
class Talk:
    """Push to talk: the visitor presses or releases the button.

    While the button is held, all sound of the microphone is one turn, whatever its pauses;
    releasing the button ends the turn at once.

    Attributes:
        pressed: True when the button was pressed, false when it was released.
    """

    pressed: bool


@dataclass(frozen=True)
class Heard:
    """Transcript of the browser's recogniser, if `welcome` asked for it.

    Attributes:
        result: Number of the result, one higher after each final text; a text replaces an earlier
            one with the same number.
        text: All words of this result so far.
        final: Whether the words will not change any more.
    """

    result: Count
    text: Words
    final: bool


@dataclass(frozen=True)
class Deaf:
    """The browser cannot recognise speech after all, so the server has to.

    Attributes:
        reason: The browser's error, for the server's log.
    """

    reason: Annotated[str, Length(0, 200)]


@dataclass(frozen=True)
class Ack:
    """Number of binary frames of this connection that have arrived, whether used or not.

    Neither page nor browser can otherwise tell what a network still holds. A page sends sound only
    slightly ahead of what is acknowledged, so that no old sound arrives after a stall.

    Attributes:
        frames: Number of frames so far.
    """

    frames: Count


@dataclass(frozen=True)
class Beat:
    """The line is up; sent from `welcome` on wherever nothing else was sent for a second.

    Nobody tells a browser of a network that has gone without a word. A page that hears nothing for
    some seconds says so and tries another connection.
    """


@dataclass(frozen=True)
class State:
    """The avatar's state.

    Attributes:
        state: `listening` while the visitor speaks, `thinking` until sound comes, `speaking`.
    """

    state: Literal["idle", "listening", "thinking", "speaking"]


@dataclass(frozen=True)
class Transcript:
    """The visitor's words, as recognised.

    Attributes:
        text: All words of this turn so far.
        final: False while the visitor is still speaking; the next transcript then replaces this
            one.
    """

    text: Words
    final: bool


@dataclass(frozen=True)
class Answer:
    """One sentence of the answer, sent just before its sound.

    Attributes:
        utterance: Number of the answer, one higher for each answer in a session.
        first_sample: Index of the sentence's first sample in the utterance, at 24 kHz.
        text: The sentence.
    """

    utterance: Count
    first_sample: Count
    text: Words


@dataclass(frozen=True)
class Spoken:
    """When the words of a sentence are spoken; it comes once all of the sentence's sound is made.

    Attributes:
        utterance: Number of the answer.
        first_sample: That of the sentence's `answer`, which may come before or after.
        starts: Index of each word's first character (code point) in the sentence, ascending.
        times: When each word begins, seconds of the utterance, ascending.
    """

    utterance: Count
    first_sample: Count
    starts: Annotated[list[Count], Length(0, MAX_WORDS)]
    times: Annotated[list[Seconds], Length(0, MAX_WORDS)]


@dataclass(frozen=True, eq=False)
class Speech:
    """100-200 ms of sound with the matching face (binary).

    Expression row `first_expression` + j belongs to the utterance's time
    (first_expression + j) / 25 s.

    Attributes:
        utterance: Number of the answer.
        index: Number of this speech message in the session.
        first_sample: Index of the first sample in the utterance, at 24 kHz.
        first_expression: Index of the first row of expressions in the utterance.
        pcm: (n,) int16 at 24 kHz.
        expressions: (rows, B) float16.
    """

    utterance: Count
    index: Count
    first_sample: Count
    first_expression: Count
    pcm: Annotated[np.ndarray, Tensor("<i2", 1, SPEECH_RATE)]
    expressions: Annotated[np.ndarray, Tensor("<f2", 2, 8000)]


@dataclass(frozen=True)
class Timeline:
    """Body time over the time of the sound, linear between points.

    The points continue those of earlier messages; earlier points from the first new one's time on
    are replaced. After the last point the body stands still until the utterance ends.

    Attributes:
        utterance: Number of the answer.
        points: Pairs (audio time, body time) in seconds, ascending in audio time.
    """

    utterance: Count
    points: Annotated[list[tuple[Seconds, Seconds]], Length(0, MAX_POINTS)]


@dataclass(frozen=True)
class Cues:
    """Gestures of a body on a skeleton during speech; cues that were sent are never withdrawn.

    Attributes:
        utterance: Number of the answer.
        cues: Gestures to make; later ones are blended over earlier ones.
        releases: Releases of gestures in this or in earlier messages.
    """

    utterance: Count
    cues: Annotated[list[Cue], Length(0, MAX_CUES)]
    releases: Annotated[list[Release], Length(0, MAX_CUES)]


@dataclass(frozen=True)
class Call:
    """The language model calls a function: a tool of the settings, a gesture or a mood.

    Attributes:
        name: Name of the function.
        arguments: Arguments as a JSON object; `{}` if they would be too long.
    """

    name: Name
    arguments: Annotated[str, Length(2, MAX_ARGUMENTS)]


@dataclass(frozen=True)
class End:
    """All sound of an utterance has been sent.

    Attributes:
        utterance: Number of the answer.
        samples: Length of the utterance at 24 kHz.
    """

    utterance: Count
    samples: Count


@dataclass(frozen=True)
class Stop:
    """The page must fall silent at once and drop everything about an utterance.

    Attributes:
        utterance: Number of the answer.
    """

    utterance: Count


@dataclass(frozen=True)
class Pause:
    """Somebody may be speaking: the page falls silent at once but keeps the utterance.

    A message `resume` or `stop` follows.

    Attributes:
        utterance: Number of the answer.
    """

    utterance: Count


@dataclass(frozen=True)
class Resume:
    """There was no interruption: the page continues at the sample where it fell silent.

    Attributes:
        utterance: Number of the answer.
    """

    utterance: Count


@dataclass(frozen=True)
class Metrics:
    """Measured durations.

    Attributes:
        name: What was measured.
        values: Milliseconds by part.
    """

    name: Name
    values: Annotated[dict[str, Milliseconds], Length(0, 32)]


ClientMessage = Hello | Notes | Audio | Text | Say | Interrupt | Clock | Talk | Heard | Deaf
ServerMessage = (
    Welcome
    | Place
    | Ack
    | Beat
    | State
    | Transcript
    | Answer
    | Spoken
    | Speech
    | Timeline
    | Cues
    | Call
    | End
    | Stop
    | Pause
    | Resume
    | Metrics
    | Error
)
CLIENT_MESSAGES = get_args(ClientMessage)
SERVER_MESSAGES = get_args(ServerMessage)
PARTS = (Service, Services, Dictation, Offer, Notice, Cue, Release)
"""Dataclasses that messages contain."""
