"""`ico3d bench chat`: many trials of each kind, and what they come to."""

import asyncio
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from ico3d.chat.settings.conversation import ChatSettings, Turns
from ico3d.errors import Ico3dError
from ico3d.measure.talking import trials
from ico3d.measure.talking.kinds import Kind
from ico3d.measure.talking.questions import Sayings, broken_off
from ico3d.measure.talking.scripted import Script
from ico3d.measure.talking.serving import serving, serving_script

BEGINNINGS = (0.8, 1.1, 1.4, 1.7)  # s of an answer that are heard before somebody speaks over it
SCRIPT = Script(recognition=0.1, language=0.15, voice=0.1)
TURNS = Turns(pause=0.2, end_silence=2.0, speculate=False)
"""Of the scripted server: whether a turn ended by its sound or by silence is plain."""

Told = Callable[[Kind], None]


@dataclass
class Results:
    """Everything measured; one list for each kind of trial.

    Attributes:
        questions: Answers; None for one that came before its question's end, or not at all.
        interruptions: Answers that were to stop.
        assents: Answers that were to go on.
        shares: Milliseconds of the server alone.
        undisturbed: Those during which the machine's host took no processor time.
    """

    questions: list[trials.Question | None] = field(default_factory=list)
    interruptions: list[trials.Interruption] = field(default_factory=list)
    assents: list[trials.Assent] = field(default_factory=list)
    shares: list[float | None] = field(default_factory=list)
    undisturbed: list[float] = field(default_factory=list)


def measure(
    bundle: Path,
    settings: Path | None,
    said: Sayings,
    kinds: Sequence[Kind],
    turns: int,
    told: Told,
) -> Results:
    """Runs all trials.

    Args:
        bundle: The avatar.
        settings: Services and timing of the server; those of the scripted one are fixed.
        said: What the visitor says.
        kinds: Kinds of trials.
        turns: How many trials of each kind.
        told: Called after each.

    Raises:
        Ico3dError: If a server does not answer.
    """
    try:
        return _measure(bundle, settings, said, kinds, turns, told)
    except TimeoutError as error:
        raise Ico3dError(
            "the avatar did not answer for 20 s: the machine is too busy, or a service fails "
            "(ico3d serve --verbose tells which)."
        ) from error


def _measure(
    bundle: Path,
    settings: Path | None,
    said: Sayings,
    kinds: Sequence[Kind],
    turns: int,
    told: Told,
) -> Results:
    results = Results()
    real: list[Kind] = [kind for kind in kinds if kind != "share"]
    if real:
        with serving(bundle, settings) as url:
            asyncio.run(talk(url, said, real, turns, results, told))
    if "share" in kinds:
        with serving_script(bundle, SCRIPT, ChatSettings(turns=TURNS)) as url:
            asyncio.run(shares(url, said, turns, results, told))
    return results


async def talk(
    url: str, said: Sayings, kinds: Sequence[Kind], turns: int, results: Results, told: Told
) -> None:
    """Runs trials of some kinds with the avatar at a URL.

    Args:
        url: Of its server.
        said: What the visitor says.
        kinds: Which trials; not those of the server's share.
        turns: How many of each kind.
        results: Where what was measured goes.
        told: Called after each.
    """
    async with trials.visit(url) as page:
        whole = await trials.whole_answer(page) if "assent" in kinds else np.zeros(0)
        for kind in kinds:
            for number in range(turns):
                after = BEGINNINGS[number % len(BEGINNINGS)]
                if kind == "questions":
                    results.questions.append(await trials.ask(page, nth(said.questions, number)))
                elif kind == "interruptions":
                    sound = nth(said.objections, number)
                    results.interruptions.append(await trials.interrupt(page, sound, after))
                else:
                    sound = nth(said.assent, number)
                    results.assents.append(await trials.assent(page, sound, after, whole))
                await trials.peace(page)
                told(kind)


async def shares(url: str, said: Sayings, turns: int, results: Results, told: Told) -> None:
    """The same for the share of a server whose services have set delays."""
    async with trials.visit(url) as page:
        for number in range(turns):
            question = await trials.ask(page, broken_off(nth(said.questions, number)))
            results.shares.append(question and share(question))
            if question and not question.is_disturbed:
                results.undisturbed.append(share(question))
            await trials.peace(page)
            told("share")


def share(question: trials.Question) -> float:
    """Milliseconds of an answer that neither services nor settings account for."""
    by_silence = question.parts["turn"] > 1000 * (TURNS.end_silence - TURNS.pause) - 100
    decided = TURNS.end_silence if by_silence else TURNS.pause + SCRIPT.recognition
    return question.arrival - 1000 * (decided + SCRIPT.language + SCRIPT.voice)


def nth(sounds: list[np.ndarray], number: int) -> np.ndarray:
    """The sentence of the n-th trial: sentences take turns."""
    return sounds[number % len(sounds)]


def figures(results: Results) -> dict[str, Any]:
    """Median and 95th percentile of everything, and counts of what went wrong."""
    answered = [question for question in results.questions if question is not None]
    spans = {
        "voice_to_voice_ms": [question.voice_to_voice for question in answered],
        "server_share_ms": [value for value in results.shares if value is not None],
        "undisturbed_share_ms": results.undisturbed,
        "duck_ms": [trial.duck for trial in results.interruptions],
        "stop_ms": [trial.stop for trial in results.interruptions],
        "assent_silence_ms": [trial.silence for trial in results.assents],
    }
    found: dict[str, Any] = {name: spread(values) for name, values in spans.items() if values}
    names = dict.fromkeys(itertools.chain.from_iterable(q.parts for q in answered))
    found["parts"] = {
        name: spread([q.parts[name] for q in answered if name in q.parts]) for name in names
    }
    found["trials"] = {
        "questions": len(results.questions),
        "questions_answered_in_order": len(answered),
        "shares": len(results.shares),
        "shares_undisturbed": len(results.undisturbed),
        "interruptions": len(results.interruptions),
        "messages_after_stop": sum(trial.after for trial in results.interruptions),
        "assents": len(results.assents),
        "assents_resumed": sum(trial.resumed for trial in results.assents),
        "assents_lossless": sum(trial.lossless for trial in results.assents),
    }
    return found


def spread(values: list[float]) -> dict[str, float]:
    """Median and 95th percentile."""
    return {"p50": float(np.percentile(values, 50)), "p95": float(np.percentile(values, 95))}


def tables(figures: dict[str, Any]) -> list[Table]:
    """The figures as tables for the terminal."""
    times, counts = Table("ms", "p50", "p95"), Table("trials", "")
    spans = {name: values for name, values in figures.items() if "p50" in values}
    for name, values in (spans | figures["parts"]).items():
        times.add_row(name.removesuffix("_ms"), f"{values['p50']:.0f}", f"{values['p95']:.0f}")
    for name, value in figures["trials"].items():
        counts.add_row(name.replace("_", " "), str(value))
    return [times, counts]
