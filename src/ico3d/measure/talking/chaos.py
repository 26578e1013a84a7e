"""What a visitor sees when something fails amid a talk, and whether the talk goes on.

Each `Case` says what happens and what must come of it; `suffer` lets it happen to a page.
"""

import asyncio
import os
import signal
import time
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from typing import Literal

from websockets.asyncio.client import connect

from ico3d.chat.supervision.apologies import apology
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import VERSION, Answer, End, Error, Hello, Place, Speech, Text
from ico3d.chat.wire.sentences import FULL
from ico3d.measure.talking.page import PATIENCE, SimulatedPage, open_page
from ico3d.measure.talking.scripted import Fault, Script
from ico3d.measure.talking.visits import ask

Happens = Literal["ask", "drop", "read slowly", "stall", "freeze", "jump", "crowd"]
"""What happens: the question alone, of which a service's fault may come; the connection is cut; a
page reads slowly, or not at all; the server's process stops, or its calendar jumps; more visitors
come than there is room for."""

ANSWER = "This is the first sentence. This is the second one. This is the third one."
LAG = 0.3  # s for each message that a slow page reads
SETTLING = 1.0  # s after which a page notices that its connection has ended


@dataclass(frozen=True)
class Case:
    """A fault, and what must come of it.

    Attributes:
        name: What it is called.
        happens: What happens.
        seconds: How long it lasts.
        fault: What a service does with the question.
        sees: What the visitor must be told; empty for nothing but the answer.
        session: What must become of the session: `same` goes on, `new` is opened for the visitor
            who comes back, `any` is either; with each, the next question is answered.
        within: Seconds after the fault's begin within which that must be possible.
    """

    name: str
    happens: Happens = "ask"
    seconds: float = 0.0
    fault: Fault | None = None
    sees: str = ""
    session: Literal["same", "new", "any"] = "same"
    within: float = 20.0

    @property
    def is_for_all(self) -> bool:
        """Whether all visitors of a server suffer it."""
        return self.happens in ("freeze", "jump", "crowd")


NO_ANSWER, NO_VOICE = apology("language", "en"), apology("voice", "en")
CASES = (
    Case("language model dies amid its answer", fault="language dies", sees=NO_ANSWER),
    Case("language model hangs", fault="language hangs", sees=NO_ANSWER, within=30),
    Case("voice dies amid a sentence", fault="voice dies"),
    Case("voice hangs amid a sentence", fault="voice hangs", within=30),
    Case("connection cut for 2 s", "drop", 2.0, within=10),
    Case("connection cut for 35 s", "drop", 35.0, session="new", within=45),
    Case("page reads slowly", "read slowly", within=60),
    *(Case(f"page stalls for {n} s", "stall", n, within=n + 15) for n in (1, 10)),
    *(Case(f"page stalls for {n} s", "stall", n, session="any", within=n + 15) for n in (35, 60)),
    Case("server stops for 10 s", "freeze", 10.0, within=25),
    Case("server's calendar jumps by a day", "jump"),
    Case("all places and the queue are full", "crowd", sees=FULL.text, session="new"),
)
SCRIPT = Script(
    answer=ANSWER, seconds=1.5, faults={case.name: case.fault for case in CASES if case.fault}
)


@dataclass
class Outcome:
    """What came of a fault.

    Attributes:
        seen: What the visitor was told, in order; captions of the faulty answer and errors.
        seconds: From the fault's begin until the next question could be asked.
        session: `same` or `new`.
        answered: Whether the next question was answered.
        whole: Whether all speech arrived, in order and without a gap.
    """

    seen: list[str] = field(default_factory=list)
    seconds: float = float("inf")
    session: str = "same"
    answered: bool = False
    whole: bool = True

    def holds(self, case: Case) -> bool:
        """Whether it is what must come of the case."""
        told = " ".join(self.seen)
        as_it_should = case.session in ("any", self.session)
        in_time = self.answered and self.seconds <= case.within
        return case.sees in told and as_it_should and in_time and self.whole


@dataclass(frozen=True)
class Stage:
    """Where it happens.

    Attributes:
        url: Address of the server.
        process: Number of its process; 0 if it is this one, which is not stopped.
    """

    url: str
    process: int = 0


async def suffer(case: Case, stage: Stage) -> Outcome:
    """Lets a fault happen to a visitor, who then asks again."""
    outcome = Outcome()
    async with AsyncExitStack() as stack:
        page, welcome = await open_page(stage.url, microphone=False)
        stack.push_async_callback(page.close)
        await page.wait(Speech, timeout=PATIENCE)
        begun = time.monotonic()
        if case.happens == "ask":
            utterance = await _ask(page, case.name)
        else:
            utterance = await ask(page)
            begun = time.monotonic()
            await HAPPENING[case.happens](case, stage, page, outcome)
        pages = [page]
        if page.is_closed:
            last = page.messages(Speech)[-1].index
            page, second = await open_page(stage.url, welcome.session, last, microphone=False)
            stack.push_async_callback(page.close)
            pages.append(page)
            outcome.session = "same" if second.resumed else "new"
        if outcome.session == "same":
            await page.wait(End, timeout=PATIENCE, where=lambda m: m.utterance == utterance)
        outcome.seconds = time.monotonic() - begun
        await page.heard(utterance) if outcome.session == "same" else None
        outcome.seen += _told(pages, utterance)
        outcome.whole = outcome.session == "new" or _is_whole(pages, utterance)
        page.lag = 0.0
        await page.heard(await ask(page))
        outcome.answered = True
    return outcome


async def _ask(page: SimulatedPage, question: str) -> int:
    since, latest = len(page.log), page.messages(Speech)[-1].utterance
    await page.send(Text(question))
    _, speech = await page.wait(Speech, since, PATIENCE, lambda m: m.utterance > latest)
    return speech.utterance


async def _drop(case: Case, _: Stage, page: SimulatedPage, __: Outcome) -> None:
    await page.vanish()
    await asyncio.sleep(case.seconds)


async def _read_slowly(_: Case, __: Stage, page: SimulatedPage, ___: Outcome) -> None:
    page.lag = LAG


async def _stall(case: Case, _: Stage, page: SimulatedPage, __: Outcome) -> None:
    await page.stall(case.seconds)
    await asyncio.sleep(SETTLING)


async def _freeze(case: Case, stage: Stage, _: SimulatedPage, __: Outcome) -> None:
    os.kill(stage.process, signal.SIGSTOP)
    try:
        await asyncio.sleep(case.seconds)
    finally:
        os.kill(stage.process, signal.SIGCONT)


async def _jump(_: Case, stage: Stage, __: SimulatedPage, ___: Outcome) -> None:
    os.kill(stage.process, signal.SIGUSR1)


async def _crowd(_: Case, stage: Stage, page: SimulatedPage, outcome: Outcome) -> None:
    """Others come until one is sent away; then all leave, and the visitor begins anew."""
    address = stage.url.replace("http", "ws", 1).rstrip("/") + "/ws"
    counted = {"talk": 1, "wait": 0}
    async with AsyncExitStack() as stack:
        while True:
            # Nobody reads what those who wait are told: without a limit it holds up no farewell.
            line = connect(address, ping_interval=None, max_queue=None)
            socket = await stack.enter_async_context(line)
            await socket.send(encode(Hello(VERSION, None, -1)))
            first = decode_server(await asyncio.wait_for(socket.recv(), PATIENCE))
            if isinstance(first, Error):
                break
            counted["wait" if isinstance(first, Place) else "talk"] += 1
    outcome.seen += [f"{counted['talk']} talk, {counted['wait']} wait; the next: {first.message}"]
    await page.close()  # it says goodbye: no session is kept


HAPPENING: dict[str, Callable[[Case, Stage, SimulatedPage, Outcome], Awaitable[None]]] = {
    "drop": _drop,
    "read slowly": _read_slowly,
    "stall": _stall,
    "freeze": _freeze,
    "jump": _jump,
    "crowd": _crowd,
}


def _told(pages: list[SimulatedPage], utterance: int) -> list[str]:
    """Captions of an answer, each once, and errors."""
    told: list[str] = []
    for page in pages:
        told += [m.text.strip() for m in page.messages(Answer) if m.utterance == utterance]
        told += [m.message for m in page.messages(Error)]
    return list(dict.fromkeys(told))


def _is_whole(pages: list[SimulatedPage], utterance: int) -> bool:
    """Whether the speech of an answer has no gap up to the end that the server told."""
    pieces = {
        m.first_sample: len(m.pcm)
        for page in pages
        for m in page.messages(Speech)
        if m.utterance == utterance
    }
    ends = [m.samples for page in pages for m in page.messages(End) if m.utterance == utterance]
    at = 0
    while at in pieces:
        at += pieces[at]
    return bool(ends) and at == ends[0]
