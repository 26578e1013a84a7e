"""SmolLM2-135M-Instruct in this process, beside the persona's notes.

A model of this size invents. So the notes answer what they know; the model answers the rest, with
the nearest notes before its eyes, as far as it is sure; of everything else the answer is that the
persona does not know.
"""

from collections.abc import AsyncGenerator, Callable, Iterable
from contextlib import aclosing
from dataclasses import dataclass

from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.language.notes import Notes
from ico3d.chat.services.language.persona import PersonaModel, question_of, sentences
from ico3d.chat.services.provider import Context, lacks_package, lacks_weights
from ico3d.common.weights import model_of
from ico3d.errors import MissingExtraError, SettingsError

WEIGHTS = "smollm2-135m"
PACKAGES = ("ctranslate2", "tokenizers")
NEAREST, NEAR = 2, 0.3  # notes before the model's eyes, and the least score of their match
REMEMBERED = 4  # messages of the conversation before the question
LONGEST_QUESTION, LONGEST_TURN = 128, 64  # tokens
MOST_TOKENS = LONGEST_QUESTION + 2 * NEAREST * LONGEST_TURN
"""Tokens that the model reads of notes, conversation and question: a second of one core."""
EXAMPLES = (
    ("user", "What did I eat today?"),
    ("assistant", "I do not know that. You have not told me."),
    ("user", "What is the capital of Italy?"),
    ("assistant", "The capital of Italy is Rome."),
    ("user", "I passed my exam!"),
    ("assistant", "Congratulations! That is wonderful to hear."),
    ("user", "What is the time?"),
    ("assistant", "I do not know that. I have no clock."),
)
"""Turns that show the model how to answer; it follows examples better than instructions."""

Turn = tuple[str, str]
"""Who said something, and what."""
Fitting = Callable[[Iterable[tuple[str, int]], int], list[str]]
"""Cuts texts, each to its number of tokens, and drops the last of them beyond a number in all."""


@dataclass(frozen=True)
class Settings:
    """Options of the language model `smollm2`, which speaks English only.

    Attributes:
        sure: Least mean natural logarithm of the probabilities with which the model chose the
            tokens of a sentence that is said; nearer to 0 the model says less and errs less.
        max_tokens: Highest number of tokens of an answer.
    """

    sure: float = -0.6
    max_tokens: int = 60

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If an answer could have no words, or `sure` is no such logarithm.
        """
        where = "chat settings: language 'smollm2'"
        if self.sure > 0:
            raise SettingsError(f"{where}: sure must be at most 0.")
        if self.max_tokens < 1:
            raise SettingsError(f"{where}: max_tokens must be at least 1.")


def hindrance(settings: Settings) -> str:
    """A sentence on a missing package or missing weights; empty if the model works."""
    missing = (lacks_package(name, "natural") for name in PACKAGES)
    return next(filter(None, missing), "") or lacks_weights(WEIGHTS)


def make(settings: Settings, context: Context) -> FrameProcessor:
    """Creates the language model of one session; the weights are loaded once for all sessions.

    Raises:
        MissingExtraError: If CTranslate2 or its tokenizers are not installed.
        MissingModelError: If the weights are not installed.
    """
    for name in PACKAGES:
        if lacks_package(name, "natural"):
            raise MissingExtraError(name, "natural", "the language model SmolLM2")
    from ico3d.chat.services.language.ctranslate import SmallModel, load

    class NotedModel(PersonaModel):
        """Answers from the notes, else by the model as far as it is sure."""

        def __init__(self, notes: Notes, model: SmallModel, begin: list[Turn]):
            super().__init__(notes)
            self._model, self._begin = model, begin

        async def answers(self, context: LLMContext) -> AsyncGenerator[str, None]:
            """Yields the sentences of an answer."""
            question = question_of(context)
            known = self._notes.known(question) if question else self._notes.not_understood()
            for sentence in sentences(known or ""):
                yield sentence
            if known or not question:
                return
            told = False
            turns = fitted(shown(self._notes, question), recent(context), self._model.fitting)
            most, sure = settings.max_tokens, settings.sure
            async with aclosing(self._model.sentences(self._begin, turns, most, sure)) as said:
                async for sentence in said:
                    told = True
                    yield sentence
            if not told:
                yield self._notes.fallback()

        async def warm_up(self) -> None:
            """Has the model read what each prompt begins with, before visitors come."""
            greeting = [("user", "Hello.")]
            async with aclosing(self._model.tokens(self._begin, greeting, 1)) as tokens:
                async for _ in tokens:
                    pass

    notes = Notes(context.persona, context.gestures)
    return NotedModel(notes, load(model_of(WEIGHTS)), beginning(context.persona.name))


def beginning(name: str) -> list[Turn]:
    """The turns with which each prompt begins: who the model is, and how it answers."""
    told = (
        f"You are {name}, a friendly virtual person who talks with a visitor. "
        "Answer in one short sentence. If you do not know, say so."
    )
    return [("system", told), *EXAMPLES]


def shown(notes: Notes, question: str) -> list[Turn]:
    """The notes that are nearest to a question, as turns of the conversation, the nearest last."""
    near = [note for note, score in notes.nearest(question, NEAREST) if score >= NEAR]
    return [
        turn
        for note in reversed(near)
        for turn in (("user", f"{note.questions[0]}?"), ("assistant", note.answer))
    ]


def fitted(notes: list[Turn], talk: list[Turn], fitting: Fitting) -> list[Turn]:
    """Notes, then the last turns of a conversation, as far as the model's tokens suffice.

    Args:
        notes: The notes that are shown, as turns.
        talk: The last turns, the question at the end.
        fitting: Cuts texts and drops the last of them (`SmallModel.fitting`).
    """
    *before, question = talk
    worth = [question, *notes, *reversed(before)]  # the longest in the conversation ago goes first
    longest = [LONGEST_QUESTION, *(LONGEST_TURN for _ in worth[1:])]
    texts = fitting(
        ((text, most) for (_, text), most in zip(worth, longest, strict=True)), MOST_TOKENS
    )
    asked, *others = ((role, text) for (role, _), text in zip(worth, texts, strict=False))
    return [*others[: len(notes)], *reversed(others[len(notes) :]), asked]


def recent(context: LLMContext) -> list[Turn]:
    """The last turns of the conversation, the question included."""
    spoken: list[Turn] = []
    for message in context.get_messages():
        role = message.get("role") if isinstance(message, dict) else None
        content = message.get("content") if isinstance(message, dict) else None
        if role in ("user", "assistant") and isinstance(content, str):
            spoken.append((role, content))
    return spoken[-REMEMBERED - 1 :]
