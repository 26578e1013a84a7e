"""The vocabulary of the wire: every message between page and server, and the limits.

`codec.py` encodes, decodes and checks by the annotations in this file, the one source, and
`python -m ico3d.chat.generating` writes `viewer/src/protocol.ts` and `docs/protocol.md` from them.
"""

from dataclasses import dataclass, field
from typing import Annotated, Literal, get_args

import numpy as np

from ico3d.chat.wire.marks import (
    MAX_EXACT,
    Count,
    Length,
    Milliseconds,
    Name,
    Range,
    Seconds,
    Tensor,
    Words,
)
from ico3d.chat.wire.protocol_gestures import MAX_CUES, Cue, Release
from ico3d.chat.wire.protocol_services import Dictation, Offer, Service, Services

VERSION = 5
MICROPHONE_RATE = 16_000  # Hz, PCM16 mono from the page
MICROPHONE_CHUNK = 512  # samples of a message: what Silero judges at once, so that none waits
SPEECH_RATE = 24_000  # Hz, PCM16 mono to the page
EXPRESSION_FPS = 25  # rows per second of an utterance's sound
MAX_TEXT_FRAME = 16 * 1024  # bytes
MAX_BINARY_FRAME = 64 * 1024  # bytes
MAX_RATE = 100  # messages per second a client may send for long
MAX_BURST = 200  # messages it may send at once
RESUME_SECONDS = 30  # how long a session waits for its page to come back
MAX_AHEAD_SECONDS = 2.0  # how far speech may run ahead of its playback
MAX_POINTS = 500  # of a timeline in one message


@dataclass(frozen=True)
class Hello:
    """First message of every connection.

    Attributes:
        version: Protocol version of the page.
        session: The session to go on with after a dropped connection; null for a new one.
        last_index: `index` of the last speech message that arrived; -1 when new.
        wishes: Keys of offers by kind that a new session is to use; heeded where `welcome` offers.
    """

    version: Count
    session: Annotated[str, Length(1, 64)] | None
    last_index: Annotated[int, Range(-1, MAX_EXACT)]
    wishes: Annotated[dict[str, Name], Length(0, 3)] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Audio:
    """Sound from the microphone (binary).

    Attributes:
        sample: Index of the first sample since the microphone opened; where it jumps, the page
            left sound out that the network did not carry.
        pcm: (n,) int16 at 16 kHz, at most 1 s; 20-100 ms serve best.
        playing: The utterance that left the loudspeaker when the last sample was recorded; null
            in silence.
        position: Seconds of it that had been heard by then; 0 in silence.
    """

    sample: Count
    pcm: Annotated[np.ndarray, Tensor("<i2", 1, MICROPHONE_RATE)]
    playing: Count | None = None
    position: Seconds = 0.0


@dataclass(frozen=True)
class Text:
    """A typed question.

    Attributes:
        text: What was typed.
    """

    text: Annotated[str, Length(1, 2000)]


@dataclass(frozen=True)
class Interrupt:
    """The visitor wants silence.

    Attributes:
        utterance: The utterance to stop; null for whatever speaks.
    """

    utterance: Count | None


@dataclass(frozen=True)
class Clock:
    """How far the page has played; every 100-250 ms while it plays, and once at the very end.

    Attributes:
        utterance: The utterance that plays.
        position: Seconds of it already heard (output latency included).
        body_time: Seconds on the body's own time line; 0 without a body.
    """

    utterance: Count
    position: Seconds
    body_time: Seconds


@dataclass(frozen=True)
class Talk:
    """Push to talk: the visitor holds the button or lets it go.

    While it is held everything that comes from the microphone is one turn, whatever its pauses;
    letting go ends the turn at once.

    Attributes:
        pressed: True when the button goes down.
    """

    pressed: bool


@dataclass(frozen=True)
class Heard:
    """What the browser's recogniser understood, where `welcome` asked for it.

    Attributes:
        result: Counts up behind each final text; while it stays, a text replaces the last one.
        text: All words of this result so far.
        final: Whether they stay as they are.
    """

    result: Count
    text: Words
    final: bool


@dataclass(frozen=True)
class Deaf:
    """The browser cannot recognise speech after all: the server is to do it.

    Attributes:
        reason: What the browser says about it, for the server's log.
    """

    reason: Annotated[str, Length(0, 200)]


@dataclass(frozen=True)
class Welcome:
    """Answer to `hello`.

    Attributes:
        version: Protocol version of the server.
        session: Name of the session, to be kept for a resume.
        resumed: True if this goes on with the session that `hello` named.
        services: Who listens, thinks and speaks.
        notices: Sentences the page shows once (what this avatar cannot do).
        dictation: How the browser is to recognise speech; null where the server does.
        offers: Services to choose from; none where strangers may be talking.
    """

    version: Count
    session: Annotated[str, Length(1, 64)]
    resumed: bool
    services: Services
    notices: Annotated[list[Words], Length(0, 8)]
    dictation: Dictation | None
    offers: Annotated[list[Offer], Length(0, 64)] = field(default_factory=list)


@dataclass(frozen=True)
class Ack:
    """Binary frames of this connection have arrived, whatever became of them.

    Neither page nor browser can tell otherwise what a network still holds. A page sends sound
    only a little ahead of what is acknowledged: after a stall no old sound arrives.

    Attributes:
        frames: How many so far.
    """

    frames: Count


@dataclass(frozen=True)
class State:
    """What the avatar does now.

    Attributes:
        state: `listening` while the visitor speaks, `thinking` until sound comes, `speaking`.
    """

    state: Literal["idle", "listening", "thinking", "speaking"]


@dataclass(frozen=True)
class Transcript:
    """What the visitor was understood to say.

    Attributes:
        text: All words of this turn so far.
        final: False while he still speaks: the next one replaces this one.
    """

    text: Words
    final: bool


@dataclass(frozen=True)
class Answer:
    """One sentence of the answer, just before its sound.

    Attributes:
        utterance: Counts up by one for each answer in a session.
        first_sample: Where in the utterance its sound starts (24 kHz).
        text: The sentence.
    """

    utterance: Count
    first_sample: Count
    text: Words


@dataclass(frozen=True, eq=False)
class Speech:
    """100-200 ms of sound and the face that belongs to it (binary).

    Expression row `first_expression` + j belongs to the utterance's time
    (first_expression + j) / 25 s.

    Attributes:
        utterance: Which answer.
        index: Counts the session's speech messages.
        first_sample: Of the utterance, at 24 kHz.
        first_expression: Index in the utterance of the first row.
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
    """Which body time belongs to which time of the sound, straight between the points.

    The points go on where those of an earlier message ended; what was planned from the first
    one's time on is replaced. After the last one the body stays, until the utterance ends.

    Attributes:
        utterance: Which answer.
        points: (audio time, body time) pairs, seconds, audio time ascending.
    """

    utterance: Count
    points: Annotated[list[tuple[Seconds, Seconds]], Length(0, MAX_POINTS)]


@dataclass(frozen=True)
class Cues:
    """What a body on a skeleton does while it speaks; nothing that was sent is taken back.

    Attributes:
        utterance: Which answer.
        cues: Gestures to make, later ones upon earlier ones.
        releases: Of these or of earlier ones.
    """

    utterance: Count
    cues: Annotated[list[Cue], Length(0, MAX_CUES)]
    releases: Annotated[list[Release], Length(0, MAX_CUES)]


@dataclass(frozen=True)
class End:
    """All sound of an utterance has been sent.

    Attributes:
        utterance: Which answer.
        samples: Length of the utterance at 24 kHz.
    """

    utterance: Count
    samples: Count


@dataclass(frozen=True)
class Stop:
    """Fall silent at once and drop everything that belongs to an utterance.

    Attributes:
        utterance: Which answer.
    """

    utterance: Count


@dataclass(frozen=True)
class Pause:
    """Somebody may speak: fall silent at once, but keep it all; `resume` or `stop` follows.

    Attributes:
        utterance: Which answer.
    """

    utterance: Count


@dataclass(frozen=True)
class Resume:
    """It was no interruption: go on with the sample at which an utterance fell silent.

    Attributes:
        utterance: Which answer.
    """

    utterance: Count


@dataclass(frozen=True)
class Metrics:
    """How long something took.

    Attributes:
        name: What was measured.
        values: Milliseconds by part.
    """

    name: Name
    values: Annotated[dict[str, Milliseconds], Length(0, 32)]


@dataclass(frozen=True)
class Error:
    """Something went wrong.

    Attributes:
        message: One sentence.
        fatal: True if the server closes the connection after it; the session is over.
        again: Whether, after a fatal one, a new session may succeed: the page offers to try again.
    """

    message: Words
    fatal: bool
    again: bool = False


ClientMessage = Hello | Audio | Text | Interrupt | Clock | Talk | Heard | Deaf
ServerMessage = (
    Welcome
    | Ack
    | State
    | Transcript
    | Answer
    | Speech
    | Timeline
    | Cues
    | End
    | Stop
    | Pause
    | Resume
    | Metrics
    | Error
)
CLIENT_MESSAGES = get_args(ClientMessage)
SERVER_MESSAGES = get_args(ServerMessage)
PARTS = (Service, Services, Dictation, Offer, Cue, Release)
"""Dataclasses that messages hold."""
