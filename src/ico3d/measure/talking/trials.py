"""Single trials with a served avatar in real time: questions, interruptions, and "uh-huh"."""

import asyncio
import time
from collections.abc import Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace

import numpy as np

from ico3d.chat.wire.protocol import (
    MICROPHONE_RATE,
    Ack,
    Answer,
    End,
    Interrupt,
    Metrics,
    Pause,
    Resume,
    ServerMessage,
    Speech,
    Stop,
    Text,
)
from ico3d.measure.talking.host import stolen_seconds
from ico3d.measure.talking.page import SCHEDULING, SimulatedPage, open_page

FADE = 0.02  # s in which the page falls silent, by far more than 20 dB
PATIENCE = 10.0  # s within which something must happen
REST = 0.7  # s of peace between two trials
LONG = "Tell me something that nobody has ever written down."  # its answer is long
SHORT = "Who are you?"
LOOK = 0.01  # s between two looks; times are those at which messages came


@dataclass(frozen=True)
class Question:
    """A question and the start of the answer; times in milliseconds.

    Attributes:
        voice_to_voice: From the question's last audible sample to the answer's first sample, as a
            page plays it.
        arrival: From the question's last audible sample to the arrival of the answer's first
            sample.
        parts: Parts of the time, as the server reports them for the same turn.
        is_disturbed: Whether the machine's host took processor time meanwhile.
    """

    voice_to_voice: float
    arrival: float
    parts: dict[str, float]
    is_disturbed: bool = False


@dataclass(frozen=True)
class Interruption:
    """A visitor spoke over an answer; times in milliseconds from the first audible sample.

    Attributes:
        duck: Until the answer was at least 20 dB quieter.
        stop: Until the answer was stopped.
        after: Number of messages of the stopped answer that arrived later.
    """

    duck: float
    stop: float
    after: int


@dataclass(frozen=True)
class Assent:
    """A visitor said "uh-huh" during an answer.

    Attributes:
        resumed: Whether the answer went on to its end.
        silence: Milliseconds for which the answer was silent.
        lossless: Whether each sample of the answer was heard exactly once and in order.
    """

    resumed: bool
    silence: float
    lossless: bool


@asynccontextmanager
async def visit(url: str):
    """A connected page after the greeting, closed at the end of the `with` block."""
    page, _ = await open_page(url)
    await page.wait(Speech)
    await peace(page)
    yield page
    await page.close()


async def peace(page: SimulatedPage) -> None:
    """Interrupts any answer and waits until nobody speaks."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        since = len(page.log)
        if page.state in ("speaking", "thinking"):
            await page.send(Interrupt(None))
        await asyncio.sleep(REST)
        if all(isinstance(message, Ack) for _, message in page.log[since:]):
            return  # an open microphone is acknowledged all the time


async def ask(page: SimulatedPage, sound: np.ndarray) -> Question | None:
    """Asks a question in real time; None if it was answered before its end or not at all."""
    since = len(page.log)
    said = page.say(sound)
    await asyncio.sleep(max(0.0, said - time.monotonic()))
    taken = stolen_seconds()

    def found() -> Question | None:
        first = first_speech(page, since)
        turns = [turn for at, turn in turns_told(page, since) if at > said]
        late = [at for at in first.values() if at > said]
        if not late or not turns:
            return None
        arrival = 1000 * (late[0] - said)
        return Question(arrival + 1000 * SCHEDULING, arrival, turns[0].values)

    await until(lambda: found() is not None, PATIENCE)
    answered = found()
    return answered and replace(answered, is_disturbed=stolen_seconds() != taken)


async def interrupt(page: SimulatedPage, sound: np.ndarray, after: float) -> Interruption:
    """Speaks over an answer after `after` seconds of it have been heard."""
    utterance = await answer_heard(page, LONG, after)
    since = len(page.log)
    onset = page.say(sound) - len(sound) / MICROPHONE_RATE

    def came(*kinds: type) -> list[tuple[float, ServerMessage]]:
        return [(at, m) for at, m in of_utterance(page, utterance, since) if isinstance(m, kinds)]

    if not await until(lambda: bool(came(Stop)), PATIENCE):
        return Interruption(1000 * PATIENCE, 1000 * PATIENCE, 0)
    signs = came(Pause, Resume, Stop)
    stopped, last = came(Stop)[0][0], len(page.log)
    was_silent = isinstance(signs[[type(m) for _, m in signs].index(Stop) - 1][1], Pause)
    await peace(page)
    late = [m for _, m in of_utterance(page, utterance, last) if type(m) in (Speech, Answer, End)]
    duck = signs[0][0] + FADE - onset
    stop = stopped + (0.0 if was_silent else FADE) - onset
    return Interruption(1000 * duck, 1000 * max(duck, stop), len(late))


async def assent(page: SimulatedPage, sound: np.ndarray, after: float, whole: np.ndarray) -> Assent:
    """Says "uh-huh" after `after` seconds of an answer, whose full sound is `whole` (S,) int16."""
    utterance = await answer_heard(page, SHORT, after)
    since = len(page.log)
    page.say(sound)

    def stopped() -> bool:
        return any(m.utterance == utterance for m in page.messages(Stop, since))

    await until(lambda: stopped() or page.has_heard(utterance), 3 * PATIENCE)
    signs = [(at, m) for at, m in of_utterance(page, utterance, since)]
    paused = [at for at, m in signs if isinstance(m, Pause)]
    resumed = [at for at, m in signs if isinstance(m, Resume)]
    silence = sum(b - a for a, b in zip(paused, resumed, strict=False))
    ended = page.has_heard(utterance) and not stopped()
    heard = sound_of(page, utterance)
    return Assent(ended, 1000 * silence, ended and np.array_equal(heard, whole))


async def whole_answer(page: SimulatedPage) -> np.ndarray:
    """The undisturbed sound of the short answer, (S,) int16 at 24 kHz."""
    utterance = await answer_heard(page, SHORT, 0.1)
    await until(lambda: page.has_heard(utterance), 3 * PATIENCE)
    await peace(page)
    return sound_of(page, utterance)


async def answer_heard(page: SimulatedPage, text: str, seconds: float) -> int:
    """Asks by text and listens for `seconds`; returns the number of the utterance being heard."""
    since = len(page.log)
    await page.send(Text(text))
    _, first = await page.wait(Speech, since)
    await until(lambda: page.player.position(time.monotonic()) >= seconds, PATIENCE)
    return first.utterance


async def until(condition: Callable[[], bool], seconds: float) -> bool:
    """Waits up to `seconds` for a condition; returns whether it became true."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        await asyncio.sleep(LOOK)
    return condition()


def first_speech(page: SimulatedPage, since: int) -> dict[int, float]:
    """Time at which each utterance began to arrive, from log entry `since` on."""
    firsts: dict[int, float] = {}
    for at, message in page.log[since:]:
        if isinstance(message, Speech):
            firsts.setdefault(message.utterance, at)
    return firsts


def of_utterance(
    page: SimulatedPage, utterance: int, since: int
) -> list[tuple[float, ServerMessage]]:
    """Messages of an utterance with their times of arrival, from log entry `since` on."""
    log = page.log[since:]
    return [(at, m) for at, m in log if getattr(m, "utterance", None) == utterance]


def sound_of(page: SimulatedPage, utterance: int) -> np.ndarray:
    """Samples (S,) of an utterance, placed as its messages say; silence in gaps."""
    pieces = [m for m in page.messages(Speech) if m.utterance == utterance]
    sound = np.zeros(sum(len(m.pcm) for m in pieces), np.int16)
    for piece in pieces:
        rest = sound[piece.first_sample :]
        rest[: len(piece.pcm)] += piece.pcm[: len(rest)]  # what comes twice is heard twice
    return sound


def turns_told(page: SimulatedPage, since: int) -> list[tuple[float, Metrics]]:
    """The server's reports on the timing of turns, with their times of arrival."""
    told = [(at, m) for at, m in page.log[since:] if isinstance(m, Metrics)]
    return [(at, metrics) for at, metrics in told if metrics.name == "turn"]
