"""Visits of a long run: who comes, talks, interrupts, vanishes, and comes back."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from random import Random

from ico3d.chat.wire.protocol import End, Interrupt, Speech, Stop, Text, Welcome
from ico3d.measure.talking.page import PATIENCE, SimulatedPage, open_page

QUESTION = "What shall I ask?"
AWAY = 1.0  # s until somebody whose connection was cut is there again

Visit = Callable[[str, bool], Awaitable[None]]


@asynccontextmanager
async def visiting(url: str, microphone: bool) -> AsyncIterator[tuple[SimulatedPage, Welcome]]:
    """A page that is closed in the end, whatever happens."""
    page, welcome = await open_page(url, microphone=microphone)
    try:
        yield page, welcome
    finally:
        await page.close()


async def talks(url: str, microphone: bool) -> None:
    """Asks twice, hears both answers to their end and leaves."""
    async with visiting(url, microphone) as (page, _):
        for _ in range(2):
            await page.heard(await ask(page))


async def interrupts(url: str, microphone: bool) -> None:
    """Stops an answer by a button, the next one by another question."""
    async with visiting(url, microphone) as (page, _):
        utterance = await ask(page)
        since = len(page.log)
        await page.send(Interrupt(utterance))
        await page.wait(Stop, since, PATIENCE, lambda m: m.utterance == utterance)
        await ask(page)
        await page.heard(await ask(page))


async def vanishes(url: str, microphone: bool) -> None:
    """Is gone amid an answer and never comes back."""
    async with visiting(url, microphone) as (page, _):
        await ask(page)
        await page.vanish()


async def returns(url: str, microphone: bool) -> None:
    """Loses the connection amid an answer, comes back and hears the rest."""
    async with visiting(url, microphone) as (page, welcome):
        utterance = await ask(page)
        await page.vanish()
    await asyncio.sleep(AWAY)
    last = page.messages(Speech)[-1].index
    again, _ = await open_page(url, welcome.session, last, microphone)
    try:
        await again.wait(End, 0, PATIENCE, lambda m: m.utterance == utterance)
        await again.heard(utterance)
    finally:
        await again.close()


async def looks_in(url: str, microphone: bool) -> None:
    """Leaves before the greeting is over."""
    async with visiting(url, microphone):
        pass


VISITS: tuple[Visit, ...] = (talks, interrupts, vanishes, returns, looks_in)


async def ask(page: SimulatedPage) -> int:
    """Asks, once the greeting has begun; returns the answer's number with its first sound."""
    await page.wait(Speech, timeout=PATIENCE)
    since, latest = len(page.log), page.messages(Speech)[-1].utterance
    await page.send(Text(QUESTION))
    _, speech = await page.wait(Speech, since, PATIENCE, lambda m: m.utterance > latest)
    return speech.utterance


async def come_and_go(
    url: str, random: Random, going_on: Callable[[], bool], came: Callable[[str], None]
) -> None:
    """One visit after the other, each kind once in a round, until `going_on` says no.

    Args:
        url: Address of the server.
        random: Draws the order of the visits; every second visitor has an open microphone.
        going_on: Asked before each visit.
        came: Receives the name of each visit that went well, of others the name and the error.
    """
    due: list[Visit] = []
    while going_on():
        due = due or random.sample(VISITS, len(VISITS))
        visit = due.pop()
        try:
            await visit(url, random.random() < 0.5)
            came(visit.__name__)
        except Exception as error:  # one that went wrong is counted, the others come all the same
            came(f"{visit.__name__}: {type(error).__name__} {error}")
        await asyncio.sleep(random.uniform(0.0, 2.0))
