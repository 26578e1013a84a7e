"""The offline language model: answers are looked up in the persona's notes."""

import re
from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass

from pipecat.frames.frames import (
    Frame,
    LLMContextFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMTextFrame,
)
from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor
from pipecat.turns.speculation_gate import SpeculationGate

from ico3d.chat.services.language.notes import Notes
from ico3d.chat.services.provider import Context


class PersonaModel(FrameProcessor):
    """A service of the pipeline that answers from a persona's notes."""

    def __init__(self, notes: Notes):
        """Creates the model of one session."""
        super().__init__()
        self._notes = notes
        self._gate = SpeculationGate()

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Answers frames with a context and passes all other frames on."""
        await super().process_frame(frame, direction)
        if not isinstance(frame, LLMContextFrame):
            await self.push_frame(frame, direction)
            return
        self._gate.begin_speculation(frame.speculation)
        await self.push_frame(LLMFullResponseStartFrame())
        async with aclosing(self.answers(frame.context)) as said:
            async for sentence in said:
                await self.push_frame(LLMTextFrame(sentence + " "))
        await self.push_frame(LLMFullResponseEndFrame())

    async def push_frame(self, frame: Frame, direction: FrameDirection = FrameDirection.DOWNSTREAM):
        """Holds an answer back until the visitor's turn has ended, as pipecat's services do."""
        for released in self._gate.process(frame, direction):
            await super().push_frame(*released)

    async def answers(self, context: LLMContext) -> AsyncGenerator[str, None]:
        """Yields the sentences of an answer."""
        question = question_of(context)
        heard = question is not None
        answer = self._notes.answer(question) if heard else self._notes.not_understood()
        for sentence in sentences(answer):
            yield sentence


def question_of(context: LLMContext) -> str | None:
    """What the visitor said last; None where the pipeline asks because it heard no words."""
    last = context.get_messages()[-1] if context.get_messages() else None
    if not isinstance(last, dict) or last.get("role") != "user":
        return None
    content = last.get("content")
    return content if isinstance(content, str) else ""


def sentences(text: str) -> list[str]:
    """Splits a text into sentences."""
    return [part for part in re.split(r"(?<=[.!?…])\s+", text.strip()) if part]


@dataclass(frozen=True)
class Settings:
    """Options of the language model `persona-notes`: none."""


def make(settings: Settings, context: Context) -> PersonaModel:
    """Creates the model of one session."""
    return PersonaModel(Notes(context.persona, context.gestures))
