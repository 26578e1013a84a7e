"""`ico3d bench sessions`: many visitors at once, each with a tone that only they may hear."""

import asyncio
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from ico3d.chat.settings.conversation import ChatSettings
from ico3d.chat.wire.protocol import SPEECH_RATE, End, Speech, Text
from ico3d.errors import SettingsError
from ico3d.measure.talking.page import PATIENCE, SCHEDULING, SimulatedPage, open_page
from ico3d.measure.talking.scripted import Script
from ico3d.measure.talking.serving import serving_script

LOWEST, APART = 200.0, 50.0  # Hz: tones of the visitors
MOST = 100  # of them: higher tones are at the end of what speech holds
SCRIPT = Script(
    answer="One. Two. Three. Four.", seconds=3.0, pitch=LOWEST, apart=APART
)  # 12 s of speech
WITHIN = 2.0  # s in which all have come, and all have asked: people do not do so at once


@dataclass(frozen=True)
class Visit:
    """What one visitor heard.

    Attributes:
        tones: Loudest tone of each piece of speech, Hz, in multiples of `APART`.
        ahead: Milliseconds by which each piece arrived before it was to be played, except the first
            piece of an utterance.
    """

    tones: list[float]
    ahead: list[float]


def measure(
    bundle: Path, visitors: int, microphones: int = 0, script: Script = SCRIPT
) -> list[Visit]:
    """Has all visitors come within `WITHIN` seconds, and ask within as many, twice.

    Args:
        bundle: The avatar to serve.
        visitors: Number of visitors who talk at once.
        microphones: Number of visitors with an open microphone.
        script: What the services of the server do.

    Returns:
        What each visitor heard.

    Raises:
        SettingsError: If there are no visitors, more than there are tones, or more microphones.
    """
    if not 1 <= visitors <= MOST:
        raise SettingsError(f"--visitors must be 1 to {MOST}.")
    if not 0 <= microphones <= visitors:
        raise SettingsError("--microphones must be at most as many as --visitors.")
    with serving_script(bundle, script, ChatSettings(max_sessions=visitors)) as url:
        return asyncio.run(visit(url, visitors, microphones))


async def visit(url: str, visitors: int, microphones: int) -> list[Visit]:
    """Has visitors ask the avatar at a URL; `microphones` of them have an open microphone."""
    opened = []
    for n in range(visitors):
        opened.append(await open_page(url, microphone=n < microphones))
        await asyncio.sleep(WITHIN / visitors)
    pages = [page for page, _ in opened]
    for utterance in (1, 2):
        delays = np.linspace(0, WITHIN, visitors)
        asking = zip(pages, delays, strict=True)
        await asyncio.gather(*(_ask(page, utterance, delay) for page, delay in asking))
    await asyncio.gather(*(page.close() for page in pages))
    return [Visit(tones(page), ahead(page)) for page in pages]


async def _ask(page: SimulatedPage, utterance: int, delay: float) -> None:
    """The first question cuts the greeting short, which is number 0 once it is heard."""
    await asyncio.sleep(delay)
    await page.wait(Speech, timeout=PATIENCE)
    await page.send(Text("What shall I ask?"))
    await page.wait(End, timeout=PATIENCE, where=lambda m: m.utterance == utterance)
    await page.heard(utterance)


def tones(page: SimulatedPage) -> list[float]:
    """The loudest tone in Hz of each piece of speech that is long enough to tell."""
    return [tone_of(m.pcm) for m in page.messages(Speech) if len(m.pcm) >= SPEECH_RATE // 10]


def tone_of(pcm: np.ndarray) -> float:
    """The loudest multiple of `APART` in samples (S,) int16 at 24 kHz, Hz."""
    heights = np.abs(np.fft.rfft(pcm * np.hanning(len(pcm)), n=SPEECH_RATE))  # one per Hz
    return float(APART * round(int(heights.argmax()) / APART))


def ahead(page: SimulatedPage) -> list[float]:
    """Milliseconds by which pieces of speech arrived early, except first pieces of utterances."""
    started: dict[int, float] = {}
    found = []
    for at, message in page.log:
        if not isinstance(message, Speech):
            continue
        if message.utterance in started:
            due = started[message.utterance] + message.first_sample / SPEECH_RATE
            found.append(1000 * (due - at))
        else:
            started[message.utterance] = at + SCHEDULING
    return found


def figures(visits: list[Visit]) -> dict[str, Any]:
    """How many visitors heard exactly one tone, their own, and how early speech arrived."""
    heard = [set(visit.tones) for visit in visits]
    own = [len(tones) == 1 and sum(bool(tones & other) for other in heard) == 1 for tones in heard]
    early = [value for visit in visits for value in visit.ahead]
    return {
        "visitors": len(visits),
        "heard_their_own_tone_only": sum(own),
        "pieces": len(early),
        "ahead_ms": {"least": min(early), "p50": float(np.median(early))},
    }


def table(figures: dict[str, Any]) -> Table:
    """The figures of `figures` as a table for the terminal."""
    shown = Table("visitors at once", str(figures["visitors"]))
    shown.add_row("heard their own tone only", str(figures["heard_their_own_tone_only"]))
    shown.add_row("pieces of speech", str(figures["pieces"]))
    early = figures["ahead_ms"]
    shown.add_row(
        "ms before they were played", f"{early['p50']:.0f}, at least {early['least']:.0f}"
    )
    return shown
