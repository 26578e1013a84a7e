"""Talks with a served avatar by the clock: questions, interruptions, and "uh-huh"."""

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
    """One question and the start of its answer, milliseconds.

    Attributes:
        voice_to_voice: From the question's last audible sample to the answer's first sample as
            a page plays it.
        arrival: The same until the first sample was there.
        parts: What the server says of the same turn.
        is_disturbed: Whether the machine's host took processor time meanwhile.
    """

    voice_to_voice: float
    arrival: float
    parts: dict[str, float]
    is_disturbed: bool = False


@dataclass(frozen=True)
class Interruption:
    """Somebody spoke over an answer; milliseconds from the first audible sample.

    Attributes:
        duck: Until the answer was at least 20 dB quieter.
        stop: Until it was stopped.
        after: Messages of the stopped answer that came later.
    """

    duck: float
    stop: float
    after: int


@dataclass(frozen=True)
class Assent:
    """Somebody said "uh-huh" while an answer was heard.

    Attributes:
        resumed: Whether the answer went on to its end.
        silence: Milliseconds for which it had fallen silent.
        lossless: Whether each sample of it was heard, once and in order.
    """

    resumed: bool
    silence: float
    lossless: bool


@asynccontextmanager
async def visit(url: str):
    """A page whose greeting is over."""
    page, _ = await open_page(url)
    await page.wait(Speech)
    await peace(page)
    yield page
    await page.close()


async def peace(page: SimulatedPage) -> None:
    """Cuts an answer short and waits until nobody says anything."""
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
    """Speaks over an answer that has been heard for `after` seconds."""
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
    """Says "uh-huh" while an answer is heard, whose sound would be `whole` (S,)."""
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
    """The sound of the short answer that nobody disturbs, (S,) int16 at 24 kHz."""
    utterance = await answer_heard(page, SHORT, 0.1)
    await until(lambda: page.has_heard(utterance), 3 * PATIENCE)
    await peace(page)
    return sound_of(page, utterance)


async def answer_heard(page: SimulatedPage, text: str, seconds: float) -> int:
    """Asks for something and listens for a while; the utterance that is being heard."""
    since = len(page.log)
    await page.send(Text(text))
    _, first = await page.wait(Speech, since)
    await until(lambda: page.player.position(time.monotonic()) >= seconds, PATIENCE)
    return first.utterance


async def until(condition: Callable[[], bool], seconds: float) -> bool:
    """Waits for a condition; whether it became true in time."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        await asyncio.sleep(LOOK)
    return condition()


def first_speech(page: SimulatedPage, since: int) -> dict[int, float]:
    """When each utterance began to arrive."""
    firsts: dict[int, float] = {}
    for at, message in page.log[since:]:
        if isinstance(message, Speech):
            firsts.setdefault(message.utterance, at)
    return firsts


def of_utterance(
    page: SimulatedPage, utterance: int, since: int
) -> list[tuple[float, ServerMessage]]:
    """What came for an utterance, with its times."""
    log = page.log[since:]
    return [(at, m) for at, m in log if getattr(m, "utterance", None) == utterance]


def sound_of(page: SimulatedPage, utterance: int) -> np.ndarray:
    """The samples of an utterance as its messages place them, (S,); silence where none came."""
    pieces = [m for m in page.messages(Speech) if m.utterance == utterance]
    sound = np.zeros(sum(len(m.pcm) for m in pieces), np.int16)
    for piece in pieces:
        rest = sound[piece.first_sample :]
        rest[: len(piece.pcm)] += piece.pcm[: len(rest)]  # what comes twice is heard twice
    return sound


def turns_told(page: SimulatedPage, since: int) -> list[tuple[float, Metrics]]:
    """What the server said of the times of turns, and when."""
    told = [(at, m) for at, m in page.log[since:] if isinstance(m, Metrics)]
    return [(at, metrics) for at, metrics in told if metrics.name == "turn"]
