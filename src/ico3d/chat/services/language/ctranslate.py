"""A small Llama-like language model in this process, through CTranslate2: int8, on one core.

The model answers in sentences of which it is sure. The mean logarithm of the probabilities with
which the model chose a sentence's tokens tells facts that it has learnt from inventions.
"""

import asyncio
import functools
import re
import threading
from collections.abc import AsyncGenerator, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ctranslate2
from tokenizers import Tokenizer

from ico3d.chat.services.language.fitting import fitting

AT_ONCE = 2  # answers generated side by side; further ones wait
BEGIN, END = "<|im_start|>", "<|im_end|>"
_ENDED = re.compile(r"[.!?…][\"”’)]*\s*$")
_loading = threading.Lock()

Turn = tuple[str, str]
"""Who said something (`system`, `user` or `assistant`), and what."""


@dataclass(frozen=True)
class Token:
    """A token of an answer.

    Attributes:
        number: The token's number in the vocabulary.
        text: The token as it stands in the vocabulary, in which `Ġ` is a space.
        log_prob: Natural logarithm of the probability with which the model chose the token.
    """

    number: int
    text: str
    log_prob: float


@dataclass(frozen=True)
class SmallModel:
    """A model that all sessions share.

    Attributes:
        generator: CTranslate2's generator.
        tokenizer: The model's tokenizer.
        threads: Threads that wait for the generator.
    """

    generator: Any
    tokenizer: Any
    threads: ThreadPoolExecutor = field(
        default_factory=lambda: ThreadPoolExecutor(AT_ONCE, "language")
    )

    async def sentences(
        self, before: Sequence[Turn], turns: Sequence[Turn], most: int, sure: float
    ) -> AsyncGenerator[str, None]:
        """Yields an answer's sentences up to the first of which the model is not sure.

        Generation stops when the caller stops iterating. A sentence that was cut off is not said.

        Args:
            before: Turns with which each prompt begins; the model's state after them is kept.
            turns: Further turns, the visitor's question last.
            most: Highest number of tokens.
            sure: Least mean logarithm of the probabilities of a sentence's tokens.
        """
        sentence: list[Token] = []
        stream = self.tokens(before, turns, most)
        try:
            async for token in stream:
                text = self.text(sentence)
                if token is None or (_ENDED.search(text) and _begins_word(token)):
                    if not _ENDED.search(text) or confidence(sentence) < sure:
                        return
                    yield text.strip()
                    sentence = []
                if token is not None:
                    sentence.append(token)
        finally:
            await stream.aclose()

    async def tokens(
        self, before: Sequence[Turn], turns: Sequence[Turn], most: int
    ) -> AsyncGenerator[Token | None, None]:
        """Yields an answer token by token, and None at its end; stops when the caller stops."""
        loop, stop = asyncio.get_running_loop(), threading.Event()
        made: asyncio.Queue[Token | None] = asyncio.Queue()

        def tell(token: Token | None) -> bool:
            """Passes a token on; returns whether the generation is to end."""
            if not stop.is_set():
                loop.call_soon_threadsafe(made.put_nowait, token)
            return stop.is_set()

        generated = loop.run_in_executor(self.threads, self._generate, before, turns, most, tell)
        try:
            while (token := await made.get()) is not None:
                yield token
            await generated
            yield None
        finally:
            stop.set()
            generated.cancel()  # if it still waits for a thread

    def text(self, tokens: Sequence[Token]) -> str:
        """The text of tokens."""
        return self.tokenizer.decode([token.number for token in tokens])

    def fitting(self, texts: Iterable[tuple[str, int]], most: int) -> list[str]:
        """The first of some texts, each cut, within so many tokens in all (`fitting`)."""
        return fitting(texts, most, lambda text: self._encoded(text).ids, self.tokenizer.decode)

    def _generate(
        self, before: Sequence[Turn], turns: Sequence[Turn], most: int, tell: Any
    ) -> None:
        def told(step: Any) -> bool:
            return tell(Token(step.token_id, step.token, step.log_prob))

        try:
            self.generator.generate_batch(
                [self._tokens_of(prompt(turns) + f"{BEGIN}assistant\n")],
                static_prompt=self._tokens_of(prompt(before)),
                max_length=most,
                sampling_topk=1,
                end_token=END,
                include_prompt_in_result=False,
                return_scores=True,
                callback=told,
            )
        finally:
            tell(None)  # or its reader waits for ever

    def _tokens_of(self, text: str) -> list[str]:
        return self._encoded(text).tokens

    def _encoded(self, text: str) -> Any:
        return self.tokenizer.encode(text)


def prompt(turns: Sequence[Turn]) -> str:
    """A conversation as models that were trained on ChatML read it."""
    return "".join(f"{BEGIN}{role}\n{plain(text)}{END}\n" for role, text in turns)


def plain(text: str) -> str:
    """A text without marks that would begin or end a turn, not even out of parts of marks."""
    while (rest := text.replace(BEGIN, "").replace(END, "")) != text:
        text = rest
    return text.strip()


def confidence(tokens: Sequence[Token]) -> float:
    """Mean logarithm of the tokens' probabilities."""
    return sum(token.log_prob for token in tokens) / max(1, len(tokens))


def load(folder: Path) -> SmallModel:
    """Loads a converted model; later calls share it."""
    with _loading:
        return _load(folder)


@functools.cache
def _load(folder: Path) -> SmallModel:
    generator = ctranslate2.Generator(
        str(folder), device="cpu", compute_type="int8", inter_threads=AT_ONCE, intra_threads=1
    )
    return SmallModel(generator, Tokenizer.from_file(str(folder / "tokenizer.json")))


def _begins_word(token: Token) -> bool:
    return token.text.startswith(("Ġ", "Ċ"))
