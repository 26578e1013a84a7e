"""`ico3d bench chat`: runs trials of each kind and summarises them."""

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
from ico3d.measure.talking.page import PATIENCE
from ico3d.measure.talking.questions import Sayings, broken_off
from ico3d.measure.talking.scripted import Script
from ico3d.measure.talking.serving import serving, serving_script

BEGINNINGS = (0.8, 1.1, 1.4, 1.7)  # s of an answer that are heard before somebody speaks over it
SCRIPT = Script(recognition=0.1, language=0.15, voice=0.1)
TURNS = Turns(pause=0.2, end_silence=2.0, speculate=False)
"""Settings of the scripted server, which make plain whether sound or silence ended a turn."""

Told = Callable[[Kind], None]


@dataclass
class Results:
    """All measurements; one list for each kind of trial.

    Attributes:
        questions: Answered questions; None for a question that was answered too early or not at
            all.
        interruptions: Trials in which the answer had to stop.
        assents: Trials in which the answer had to go on.
        shares: Milliseconds per answer that the server itself took.
        undisturbed: Those of `shares` during which the machine's host took no processor time.
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
        bundle: The avatar to serve.
        settings: File with services and timing of the server; the scripted server has its own.
        said: What the visitor says.
        kinds: Kinds of trials.
        turns: Number of trials of each kind.
        told: Called with the kind of trial after each trial.

    Raises:
        Ico3dError: If a server does not answer.
    """
    try:
        return _measure(bundle, settings, said, kinds, turns, told)
    except TimeoutError as error:
        raise Ico3dError(
            f"the avatar did not answer for {PATIENCE:g} s: the machine is too busy, or a service "
            "fails (ico3d serve --verbose tells which)."
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
    """Runs trials of some kinds against the server of an avatar.

    Args:
        url: URL of the server.
        said: What the visitor says.
        kinds: Kinds of trials, except `share`.
        turns: Number of trials of each kind.
        results: Receives the measurements.
        told: Called with the kind of trial after each trial.
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
    """Measures the server's own share of each answer; its services must have set delays.

    Args:
        url: URL of the server.
        said: What the visitor says.
        turns: Number of trials.
        results: Receives the measurements.
        told: Called with the kind of trial after each trial.
    """
    async with trials.visit(url) as page:
        for number in range(turns):
            question = await trials.ask(page, broken_off(nth(said.questions, number)))
            results.shares.append(share(question) if question else None)
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
    """The sentence of trial `number`; trials take the sentences in turn."""
    return sounds[number % len(sounds)]


def figures(results: Results) -> dict[str, Any]:
    """Median and 95th percentile of all measurements, and counts of failures."""
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
    """Median and 95th percentile of some values."""
    return {"p50": float(np.percentile(values, 50)), "p95": float(np.percentile(values, 95))}


def tables(figures: dict[str, Any]) -> list[Table]:
    """The figures of `figures` as tables for the terminal."""
    times, counts = Table("ms", "p50", "p95"), Table("trials", "")
    spans = {name: values for name, values in figures.items() if "p50" in values}
    for name, values in (spans | figures["parts"]).items():
        times.add_row(name.removesuffix("_ms"), f"{values['p50']:.0f}", f"{values['p95']:.0f}")
    for name, value in figures["trials"].items():
        counts.add_row(name.replace("_", " "), str(value))
    return [times, counts]
