"""Cuts an answer, while it is being written, into pieces that are spoken one by one.

pipecat's rules (sentencex) find the ends of sentences, so that abbreviations, numbers, times,
addresses and initials do not end one. In addition, the first piece of an answer may end at a
clause, so that the voice can begin sooner, and a line break ends a piece.
"""

import asyncio
import re
from collections.abc import AsyncIterator

from pipecat.frames.frames import Frame, LLMFullResponseStartFrame
from pipecat.processors.aggregators.llm_text_processor import LLMTextProcessor
from pipecat.processors.frame_processor import FrameDirection
from pipecat.utils.string import SENTENCE_ENDING_PUNCTUATION
from pipecat.utils.text.base_text_aggregator import Aggregation, TextType
from pipecat.utils.text.simple_text_aggregator import SimpleTextAggregator

from ico3d.chat.pipecat_internals import aggregated, sentence_end, set_aggregated
from ico3d.chat.services.voice.markup import EMOJI

LEAST_WORDS = 2  # of a clause: a single word sounds torn off, and is over before more has come
LEAST_LETTERS = 4  # the same for scripts without spaces
MOST_WORDS = 12  # after which the first piece ends between two words, clause or not
MOST_LETTERS = 400  # of a piece: for each letter all that is left before it is looked at
MOST_STOPS = 24  # of a piece, such as of initials: behind each all that is left is looked at
TURN = 16  # letters that come at once, after which others have their turn
UNMARKED_LETTERS = 40  # after which a space ends a sentence of a script that has no full stop

_CLOSER = r"[\"'”’»)\]*_`」』）】]"
_CLAUSE = re.compile(
    # a mark before white space: no decimal comma, no time of day, no address
    rf"[,;:،؛]{_CLOSER}*(?=\s)"
    rf"|[，、；：]{_CLOSER}*"
    r"|(?<=[^\W\d])\s?—|(?<=[^\W\d]) [–-](?=\s)"
)
_WIDE = re.compile(r"[\u0e00-\u0eff\u1000-\u109f\u1780-\u17ff\u2e80-\u9fff\uf900-\ufaff]")
_UNMARKED = re.compile(r"(?<=[\u0e00-\u0eff\u1000-\u109f\u1780-\u17ff])\s+")  # Thai to Khmer
_LISTED = re.compile(r"[\W_]*+\d{1,3}[.)]\s*\S?")  # the number of a list's entry, and no more
_EMOJI = re.compile(rf"{EMOJI}|[\u200d\ufe0f]")
_TRAILING = re.compile(rf"\s*{EMOJI}(\s|{_EMOJI.pattern})*")


class Clauses(SimpleTextAggregator):
    """Yields the first clause of an answer as soon as it is complete, then whole sentences.

    All pieces together are the answer, except for white space between them.
    """

    def __init__(self, language: str | None = None):
        """Sets the language of the answers, a code such as `de`; by default English."""
        super().__init__(language=language)
        self._first = True
        self._marks = self._spaces = 0  # up to where they were looked at: none is twice

    @property
    def _rest(self) -> str:
        """What has not been yielded yet."""
        return aggregated(self)

    @_rest.setter
    def _rest(self, text: str) -> None:
        set_aggregated(self, text)

    async def reset(self) -> None:
        """Forgets the text."""
        await super().reset()
        self._marks = self._spaces = 0

    async def begin(self, hurried: bool = True) -> None:
        """Starts a new answer, whose first piece may end at a clause if it is `hurried`."""
        await self.reset()
        self._first = hurried

    async def aggregate(self, text: str) -> AsyncIterator[Aggregation]:
        """Adds text of the answer; yields the pieces that are complete.

        Others get their turns meanwhile: an answer may be there at once.
        """
        for count, char in enumerate(text, 1):
            if count % TURN == 0:
                await asyncio.sleep(0)
            piece = await self._add(char)
            if piece is not None and piece.strip():
                self._first = False
                yield Aggregation(piece.strip(), TextType.SENTENCE)

    async def flush(self) -> Aggregation | None:
        """The rest of the answer, or None."""
        rest = self._rest.strip()
        await self.begin()
        return Aggregation(rest, TextType.SENTENCE) if rest else None

    async def handle_interruption(self) -> None:
        """Discards the rest of the answer."""
        await self.begin()

    async def _add(self, char: str) -> str | None:
        """The piece that a further character shows to be complete."""
        if char == "\n":
            self._rest += char
            return await self._cut(len(self._rest))
        self._rest += char
        text = self._rest
        if len(text) > MOST_LETTERS or text.count(".") > MOST_STOPS:
            spaces = (at for at, letter in enumerate(text, 1) if letter.isspace())
            return await self._cut(max(spaces, default=len(text)))
        if _EMOJI.fullmatch(char) or not await self._is_worth_a_look():
            return None
        sentence = await sentence_end(self, char)
        if sentence is not None:
            self._marks = self._spaces = 0
            return await self._with_trailing(text)
        end = self._clause_end(char) if self._first else 0
        end = end or self._unmarked_end()
        return await self._cut(end) if end else None

    async def _is_worth_a_look(self) -> bool:
        """Whether a piece may end here: not behind the number of a list's entry alone."""
        if not _LISTED.fullmatch(self._rest):
            return True
        await self._restart(self._rest)
        return False

    async def _with_trailing(self, text: str) -> str:
        """The sentence that has just been cut off the front of `text`, and emoji behind it."""
        rest = self._rest
        trailing = _TRAILING.match(rest)
        if trailing:
            rest = rest[trailing.end() :]
            await self._restart(rest)
        return text[: len(text) - len(rest)]

    def _clause_end(self, char: str) -> int:
        """Where the first clause ends; 0 if it is not complete. It is when something follows."""
        if char.isspace() or char in SENTENCE_ENDING_PUNCTUATION or re.fullmatch(_CLOSER, char):
            return 0
        for mark in _CLAUSE.finditer(self._rest[:-1], self._marks):
            self._marks = mark.end()
            if _is_long_enough(self._rest[: mark.end()]):
                return mark.end()
        words = list(re.finditer(r"\S+", self._rest[:-1]))
        is_new_word = self._rest[-2:-1].isspace()
        return words[-1].end() if is_new_word and len(words) >= MOST_WORDS else 0

    def _unmarked_end(self) -> int:
        """Where a sentence ends whose script marks ends by spaces; 0 if it does not yet."""
        least = LEAST_LETTERS if self._first else UNMARKED_LETTERS
        for space in _UNMARKED.finditer(self._rest[:-1], self._spaces):
            self._spaces = space.end()
            if _letters(self._rest[: space.start()]) >= least:
                return space.start()
        return 0

    async def _cut(self, end: int) -> str:
        piece, rest = self._rest[:end], self._rest[end:]
        await self._restart(rest)
        return piece

    async def _restart(self, text: str) -> None:
        """Forgets what it was waiting for."""
        await self.reset()
        self._rest = text


class ClauseProcessor(LLMTextProcessor):
    """The processor between language model and voice, which turns streamed text into pieces."""

    def __init__(self, language: str | None = None):
        """Creates the processor of one session."""
        self._clauses = Clauses(language)
        super().__init__(text_aggregator=self._clauses)

    async def process_frame(self, frame: Frame, direction: FrameDirection) -> None:
        """Replaces the model's text by pieces and passes all other frames on."""
        if isinstance(frame, LLMFullResponseStartFrame):
            await self._clauses.begin()
        await super().process_frame(frame, direction)


async def sentences_of(text: str, language: str | None = None) -> list[str]:
    """The sentences of a text that is there as a whole.

    Args:
        text: All of it.
        language: Its language, a code such as `de`; by default English.
    """
    clauses, found = Clauses(language), list[str]()
    await clauses.begin(hurried=False)
    async for piece in clauses.aggregate(text):
        found.append(piece.text)
    rest = await clauses.flush()
    return [*found, rest.text] if rest else found


def _letters(text: str) -> int:
    return sum(char.isalnum() for char in text)


def _is_long_enough(clause: str) -> bool:
    if _WIDE.search(clause):
        return _letters(clause) >= LEAST_LETTERS
    return sum(any(map(str.isalnum, word)) for word in clause.split()) >= LEAST_WORDS
