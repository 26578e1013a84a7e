"""Asks the packaged avatar thirty questions, to be judged by a person: notes, model, and both.

The questions stand in `bench/talk/questions.json` with what a right answer says; the rule of
judging and the verdicts stand in docs/benchmarks.md. Needs the extra `natural` and its weights.
"""

import asyncio
import json
import math
import sys
import time
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass
from pathlib import Path

from pipecat.processors.aggregators.llm_context import LLMContext

from ico3d.bundle.format import Bundle
from ico3d.chat.services.language import persona, smollm
from ico3d.chat.services.language.ctranslate import load
from ico3d.chat.services.language.notes import Notes
from ico3d.chat.services.provider import Context
from ico3d.cli import run_script
from ico3d.common.files import write_atomic
from ico3d.common.weights import model_of

QUESTIONS = Path(__file__).with_name("questions.json")
Answering = Callable[[str], AsyncGenerator[str, None]]


@dataclass(frozen=True)
class Answers:
    """Options.

    Attributes:
        questions: File with the questions.
        json: File for the answers and their times.
    """

    questions: Path = QUESTIONS
    json: Path | None = None

    def run(self) -> None:
        """Prints the answers of each way to answer, and writes the file."""
        asked = json.loads(self.questions.read_text())
        answered = asyncio.run(answers([entry["ask"] for entry in asked]))
        table = [
            entry | {way: told[at] for way, told in answered.items()}
            for at, entry in enumerate(asked)
        ]
        for row in table:
            print(f"\n{row['ask']}  [{row['fact']}]")
            for way in answered:
                print(f"  {way}: {row[way]['said']}  ({row[way]['cpu']:.2f} CPU s)")
        if self.json is not None:
            write_atomic(self.json, json.dumps(table, indent=1, ensure_ascii=False).encode())


async def answers(questions: list[str]) -> dict[str, list[dict]]:
    """For each way to answer: texts and CPU seconds."""
    context = Context(Bundle.open(Path("demo")).manifest.persona, None, None)  # type: ignore[arg-type]
    notes = Notes(context.persona)
    model = load(model_of(smollm.WEIGHTS))
    begin = smollm.beginning(context.persona.name)

    def alone(question: str) -> AsyncGenerator[str, None]:
        turns = [*smollm.shown(notes, question), ("user", question)]
        return model.sentences(begin, turns, smollm.Settings().max_tokens, -math.inf)

    def of(service: persona.PersonaModel) -> Answering:
        return lambda question: service.answers(LLMContext([{"role": "user", "content": question}]))

    both = smollm.make(smollm.Settings(), context)
    await both.warm_up()  # type: ignore[attr-defined]
    ways: dict[str, Answering] = {
        "notes": of(persona.make(persona.Settings(), context)),
        "model": alone,
        "both": of(both),  # type: ignore[arg-type]
    }
    return {way: [await timed(answer(q)) for q in questions] for way, answer in ways.items()}


async def timed(said: AsyncGenerator[str, None]) -> dict:
    """An answer, the CPU time it took, and the time until its first sentence."""
    began, spent, first = time.monotonic(), time.process_time(), 0.0
    sentences = []
    async for sentence in said:
        first = first or time.monotonic() - began
        sentences.append(sentence)
    return {"said": " ".join(sentences), "cpu": time.process_time() - spent, "first": first}


if __name__ == "__main__":
    sys.exit(run_script(Answers))
