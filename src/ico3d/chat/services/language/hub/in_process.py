"""A causal language model of transformers as a service of the pipeline.

torch is imported only by transformers, so a server without this service does not need torch.
"""

import asyncio
import threading
from collections.abc import AsyncGenerator
from concurrent.futures import ThreadPoolExecutor
from contextlib import aclosing
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

from pipecat.frames.frames import (
    Frame,
    LLMContextFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    LLMThoughtTextFrame,
)
from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.processors.frame_processor import FrameDirection
from pipecat.services.llm_service import LLMService
from pipecat.services.settings import LLMSettings
from pipecat.utils.types import assert_given
from transformers import AsyncTextIteratorStreamer, StoppingCriteria, StoppingCriteriaList
from transformers.utils.import_utils import is_torch_cuda_available

from ico3d.chat.pipecat_internals import check_schema, push_text, settings_of
from ico3d.chat.services.language.fitting import fitting
from ico3d.chat.services.language.hub.loading import load_model
from ico3d.chat.services.language.hub.prompts import Prompts, prompts_of
from ico3d.chat.services.language.reasoning import (
    Parts,
    Thoughts,
    opens_thoughts,
    without_thoughts,
)
from ico3d.common.native.isolated import RefusedError
from ico3d.errors import ModelError

AT_ONCE = 2  # answers generated side by side; further ones wait
MOST_TOLD, MOST_TALK, LONGEST_MESSAGE = 3072, 1024, 256
"""Tokens that a model reads of its instruction, of the conversation, and of one message."""
LONGEST_PROMPT = 2 * (MOST_TOLD + MOST_TALK)
"""Tokens that a model reads of all of these, and of what its chat template writes about them."""
_loading = threading.Lock()


class Stop(StoppingCriteria):
    """A stopping criterion that ends a generation from outside, after the current token."""

    def __init__(self):
        """Starts unset."""
        self._event = threading.Event()

    def set(self) -> None:
        """Ends the generation."""
        self._event.set()

    def __call__(self, input_ids: Any, scores: Any, **kwargs: Any) -> Any:
        """Whether to stop; transformers accepts one value for the whole batch."""
        return self._event.is_set()


@dataclass(frozen=True)
class Loaded:
    """A model that all sessions share.

    Attributes:
        folder: Folder of the model.
        model: The causal language model of transformers.
        tokenizer: The model's tokenizer.
        prompts: Writes prompts by the model's chat template.
        opens: Whether the chat template opens a thought, so that answers contain only its end mark.
        threads: Threads that generate.
    """

    folder: Path
    model: Any
    tokenizer: Any
    prompts: Prompts
    opens: bool
    threads: ThreadPoolExecutor = field(
        default_factory=lambda: ThreadPoolExecutor(AT_ONCE, "language")
    )

    async def stream(
        self, messages: list[dict[str, Any]], most: int, temperature: float | None = None
    ) -> AsyncGenerator[str, None]:
        """Yields an answer piece by piece; generation stops when the caller stops iterating.

        Args:
            messages: Roles and contents, the system instruction first.
            most: Highest number of tokens.
            temperature: Temperature of sampling; None for the model's own settings.
        """
        streamer = AsyncTextIteratorStreamer(
            self.tokenizer, skip_prompt=True, skip_special_tokens=True
        )
        stop = Stop()
        run = asyncio.get_running_loop().run_in_executor
        generated = run(
            self.threads, self._generate, messages, chosen(most, temperature), streamer, stop
        )
        try:
            async for text in streamer:
                if text:
                    yield text
            await generated
        finally:
            stop.set()
            generated.cancel()  # if it still waits for a thread

    def _generate(
        self, messages: list[dict[str, Any]], how: dict[str, Any], streamer: Any, stop: Stop
    ) -> None:
        try:
            written = self.prompts.of(self._fitting(messages))
            prompt = self.tokenizer(written, add_special_tokens=False, return_tensors="pt")
            prompt = prompt.to(self.model.device)
            if prompt["input_ids"].shape[1] > LONGEST_PROMPT:
                raise ModelError(f"its chat template writes more than {LONGEST_PROMPT} tokens.")
            criteria = StoppingCriteriaList([stop])
            self.model.generate(**prompt, **how, streamer=streamer, stopping_criteria=criteria)
        except BaseException:
            streamer.on_finalized_text("", stream_end=True)  # or its reader waits for ever
            raise

    def _fitting(self, messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """The instruction and the newest messages within the tokens that the model reads.

        What is left of a conversation begins with the visitor, as some models' templates demand.
        """
        told = [message for message in messages if message["role"] == "system"]
        talk = [message for message in reversed(messages) if message["role"] != "system"]
        how = (partial(self.tokenizer.encode, add_special_tokens=False), self.tokenizer.decode)
        begin = fitting(((str(one["content"]), MOST_TOLD) for one in told), MOST_TOLD, *how)
        said = fitting(((str(one["content"]), LONGEST_MESSAGE) for one in talk), MOST_TALK, *how)
        while 1 < len(said) < len(talk) and talk[len(said) - 1]["role"] != "user":
            said.pop()
        kept = [*zip(told, begin, strict=False), *reversed([*zip(talk, said, strict=False)])]
        return [message | {"content": text} for message, text in kept]


def chosen(most: int, temperature: float | None) -> dict[str, Any]:
    """Options of sampling for transformers; others come from the model's own file."""
    how: dict[str, Any] = {"max_new_tokens": most}
    if temperature is None:
        return how
    if temperature == 0:
        return {**how, "do_sample": False}
    return {**how, "do_sample": True, "temperature": temperature}


def on_cuda() -> bool:
    """Whether models run on a CUDA device."""
    return is_torch_cuda_available()


def load(folder: Path) -> Loaded:
    """Loads a model from its folder; later calls share it.

    Raises:
        ModelError: If the folder does not hold all of a model.
    """
    with _loading:
        return _load(folder)


@cache
def _load(folder: Path) -> Loaded:
    how = {"device_map": "cuda", "dtype": "auto"} if on_cuda() else {"dtype": "float32"}
    model, tokenizer = load_model(folder, **how)
    prompts = prompts_of(tokenizer)
    try:
        opens = opens_thoughts(prompts.of([{"role": "user", "content": "?"}]))
    except RefusedError:  # a template may want anything; it then says so with the first question
        opens = False
    return Loaded(folder, model, tokenizer, prompts, opens)


class InProcessModel(LLMService):
    """A language model in this process; streams its answers, cannot call functions."""

    def __init__(
        self, loaded: Loaded, instruction: str, max_tokens: int, temperature: float | None = None
    ):
        """Creates the language model of one session.

        Args:
            loaded: The shared model.
            instruction: System instruction: who the avatar is.
            max_tokens: Highest number of tokens of an answer.
            temperature: Temperature of sampling; None for the model's own settings.
        """
        super().__init__(
            settings=LLMSettings(
                model=loaded.folder.name,
                system_instruction=instruction,
                temperature=temperature,
                max_tokens=max_tokens,
                top_p=None,
                top_k=None,
                frequency_penalty=None,
                presence_penalty=None,
                seed=None,
                filter_incomplete_user_turns=False,
                user_turn_completion_config=None,
            )
        )
        self._loaded, self._max_tokens = loaded, max_tokens

    async def process_frame(self, frame: Frame, direction: FrameDirection):
        """Answers frames with a context and passes all other frames on."""
        await super().process_frame(frame, direction)
        if not isinstance(frame, LLMContextFrame):
            await self.push_frame(frame, direction)
            return
        await self.push_frame(LLMFullResponseStartFrame())
        try:
            await self.start_ttfb_metrics()
            messages = await self._messages(frame.context, None)
            thoughts = Thoughts(self._loaded.opens)
            async with aclosing(self._loaded.stream(messages, *self._limits())) as texts:
                async for text in texts:
                    await self.stop_ttfb_metrics()
                    await self._tell(thoughts.push(text))
            if rest := thoughts.finish().said:
                await push_text(self, rest)
        except Exception as error:
            await self.push_error(f"The language model failed: {error}", exception=error)
        finally:
            await self.push_frame(LLMFullResponseEndFrame())

    async def run_inference(
        self,
        context: LLMContext,
        max_tokens: int | None = None,
        system_instruction: str | None = None,
        response_schema: dict[str, Any] | None = None,
    ) -> str | None:
        """A whole answer outside of the conversation, such as a summary of it."""
        check_schema(self, response_schema)
        messages = await self._messages(context, system_instruction)
        most, temperature = self._limits()
        stream = self._loaded.stream(messages, max_tokens or most, temperature)
        async with aclosing(stream) as texts:
            text = "".join([text async for text in texts])
        return without_thoughts(text, self._loaded.opens)

    def _limits(self) -> tuple[int, float | None]:
        """The longest answer, and the temperature, as whoever asks may have changed them."""
        settings = settings_of(self)
        longest = assert_given(settings.max_tokens) or self._max_tokens
        return longest, assert_given(settings.temperature)

    async def _tell(self, parts: Parts) -> None:
        if parts.said:
            await push_text(self, parts.said)
        else:
            await self.push_frame(LLMThoughtTextFrame(parts.thought))

    async def _messages(self, context: LLMContext, instruction: str | None) -> list[Any]:
        request = await self.get_llm_adapter().get_llm_invocation_params(
            context,
            system_instruction=instruction or assert_given(settings_of(self).system_instruction),
            convert_developer_to_user=True,  # chat templates do not know that role
        )
        return request["messages"]
