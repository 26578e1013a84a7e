"""pipecat's OpenAI service, adapted to servers that lack some of OpenAI's features."""

import contextlib
import re
from collections.abc import AsyncGenerator, Sequence
from contextvars import ContextVar
from dataclasses import replace
from typing import Any

import httpx2
from loguru import logger
from openai import APIStatusError, AsyncOpenAI, AsyncStream
from openai.types.chat import ChatCompletionChunk
from openai.types.chat.chat_completion_chunk import ChoiceDelta
from pipecat.adapters.llm.services.open_ai_adapter import OpenAILLMInvocationParams
from pipecat.frames.frames import LLMThoughtTextFrame
from pipecat.processors.aggregators.llm_context import LLMContext
from pipecat.services.llm_service import FunctionCallFromLLM
from pipecat.services.openai.llm import OpenAILLMService

from ico3d.chat.observing.failures import cause
from ico3d.chat.pipecat_internals import push_text
from ico3d.chat.services.language.reasoning import Parts, Thoughts, field_of, without_thoughts
from ico3d.chat.settings.keys import is_openai
from ico3d.chat.wire.characters import sendable, sendable_json

MOST_ROUNDS = 4
"""How often a model may call functions in one turn before it must answer in words."""
MOST_OF_CALLS = 64 << 10
"""Letters of the names, numbers and arguments of an answer's functions."""
MOST_CALLS = 8
"""Functions that one answer may call: a visitor can talk a model into asking for many."""
COMPLETE = ("stop", "tool_calls", "function_call")
"""Reasons for the end of an answer that was not cut off."""
_BLANKS = re.compile(r"(\s{64})\s+")
"""More blanks than anybody writes; the marks between clauses are looked for one by one."""
_opens: dict[tuple[str, str], bool] = {}
"""By server and model: whether its chat template opens a thought, so that a stream holds only the
end of it. One answer tells (`warm_up` asks for one); of a model that is not in here the first is
given out when it is whole.
"""
_summarising: ContextVar[bool] = ContextVar("summarising", default=False)


class CompatibleModel(OpenAILLMService):
    """A language model that does without functions if its server does not support them."""

    supports_developer_role = False  # chat templates of open models do not know it

    def __init__(
        self,
        client: dict[str, Any],
        model: str,
        instruction: str,
        functions: bool,
        sampling: dict[str, Any],
    ):
        """Creates the language model of one session.

        Args:
            client: Options of the SDK's client.
            model: Name of the model.
            instruction: System instruction: who the avatar is.
            functions: Whether the model may call functions.
            sampling: Further settings of pipecat for a request.
        """
        self._made_with = client
        super().__init__(
            settings=OpenAILLMService.Settings(
                model=model, system_instruction=instruction, **sampling
            ),
        )
        self._functions_allowed = self._may_call = functions
        self._place = (str(client["base_url"]), model)
        if is_openai(client["base_url"]):
            _opens.setdefault(self._place, False)  # its thoughts stay with it

    def create_client(self, *_, **__) -> AsyncOpenAI:
        """Creates the client for pipecat's requests."""
        return AsyncOpenAI(**self._made_with)

    def build_chat_completion_params(
        self, params_from_context: OpenAILLMInvocationParams
    ) -> dict[str, Any]:
        """The parameters of a request, without functions if there are none."""
        params = super().build_chat_completion_params(params_from_context)
        self._may_call = self._functions_allowed and rounds(params["messages"]) < MOST_ROUNDS
        if not self._may_call:
            for name in ("tools", "tool_choice"):
                params.pop(name, None)
        if _summarising.get():
            params.pop("max_tokens", None)
        return _past_the_sdk(params)

    async def run_inference(self, *args: Any, **options: Any) -> str | None:
        """A whole answer outside of the conversation, such as a summary, of its own length."""
        token = _summarising.set(True)
        try:
            text = await super().run_inference(*args, **options)
        finally:
            _summarising.reset(token)
        return text and without_thoughts(text)

    async def run_function_calls(self, function_calls: Sequence[FunctionCallFromLLM]) -> None:
        """Calls the functions that an answer asks for, the first ones of too many.

        Some servers' models call functions although they were offered none.
        """
        if not self._may_call:
            logger.warning("language called functions that it was not offered; none is run")
            return
        if len(function_calls) > MOST_CALLS:
            logger.warning(f"language called {len(function_calls)} functions; {MOST_CALLS} are run")
        await super().run_function_calls(
            [
                replace(
                    call,
                    function_name=sendable(call.function_name),
                    tool_call_id=sendable_json(call.tool_call_id),
                    arguments=sendable_json(call.arguments),
                )
                for call in function_calls[:MOST_CALLS]
            ]
        )

    # type: ignore (whoever reads the stream asks it for no more than chunks)
    async def get_chat_completions(
        self, context: LLMContext
    ) -> AsyncGenerator[ChatCompletionChunk, None]:
        """Sends a request and removes thoughts from the answer."""
        return self._without_thoughts(await self._asked(context))

    async def _without_thoughts(
        self, stream: AsyncStream[ChatCompletionChunk]
    ) -> AsyncGenerator[ChatCompletionChunk, None]:
        """The stream with what is said alone; signs of thinking go down beside it."""
        opens = _opens.get(self._place)
        thoughts, end, letters = Thoughts(False if opens is False else None), None, 0
        async with contextlib.aclosing(_closing(stream)) as chunks:
            async for chunk in chunks:
                for choice in chunk.choices or []:
                    end = choice.finish_reason or end
                    letters += _letters_of_calls(choice.delta)
                    if letters > MOST_OF_CALLS:
                        raise httpx2.ReadError("its calls of functions are too long")
                    await self._take_apart(choice.delta, thoughts)
                yield chunk
        if end == "length" and opens and not thoughts.begun:
            return  # it was cut off within its thoughts
        await self._tell(thoughts.finish(end != "length"))
        self._learn(thoughts, end)

    async def warm_up(self) -> None:
        """Requests a short answer before visitors come.

        A server loads its model with the first request. The answer also shows whether the model's
        text begins within a thought; unless it does, later answers can be passed on while they
        arrive.

        Raises:
            OpenAIError: If the server does not answer.
        """
        if self._place in _opens:
            return
        thoughts, end = Thoughts(None), None
        greeting = LLMContext([{"role": "user", "content": "Say hello."}])
        async with contextlib.aclosing(_closing(await self._asked(greeting))) as chunks:
            async for chunk in chunks:
                for choice in chunk.choices or []:
                    end = choice.finish_reason or end
                    if choice.delta and field_of(choice.delta):
                        thoughts.separate()
                    if choice.delta and choice.delta.content:
                        thoughts.push(choice.delta.content)
        thoughts.finish()
        self._learn(thoughts, end)

    def _learn(self, thoughts: Thoughts, end: str | None) -> None:
        """What a whole answer tells of a model that is new: a later one may speak of such tags."""
        if thoughts.lone:
            _opens.setdefault(self._place, True)
        elif thoughts.begun and end in COMPLETE:
            _opens.setdefault(self._place, False)

    async def _take_apart(self, delta: ChoiceDelta | None, thoughts: Thoughts) -> None:
        if delta is None:
            return
        apart = field_of(delta)
        if apart:
            await self._tell(thoughts.separate())
        if delta.content:
            parts = thoughts.push(_BLANKS.sub(r"\1", sendable(delta.content)))
            delta.content = parts.said or None
            apart = apart if parts.said else (apart or "") + parts.thought
        if apart is not None:
            await self.push_frame(LLMThoughtTextFrame(apart))

    async def _tell(self, parts: Parts) -> None:
        if parts.said:
            await push_text(self, parts.said)

    async def _asked(self, context: LLMContext) -> AsyncStream[ChatCompletionChunk]:
        """Asks; once more without functions if the server may have refused those.

        Servers do so in words of their own, for models that call none, and for functions whose
        parameters they cannot make a grammar of.
        """
        try:
            return await super().get_chat_completions(context)
        except APIStatusError as error:
            told = error.status_code in (400, 422) or "tool" in str(error).lower()
            if not self._functions_allowed or not told:
                raise
            self._functions_allowed = False
            try:
                answer = await super().get_chat_completions(context)
            except APIStatusError:
                self._functions_allowed = True  # it was something else
                raise error from None
            logger.warning(f"language goes on without functions, refused by {cause(error)}")
            return answer


def _past_the_sdk(params: dict[str, Any]) -> dict[str, Any]:
    """Parameters of which the SDK sends messages and functions as they are.

    It has nothing to convert there, and looks at each part of each message for that, in the loop of
    everybody: at the parts of 1 MB for four seconds.
    """
    written = {name: params[name] for name in ("messages", "tools") if params.get(name)}
    more = {**(params.get("extra_body") or {}), **written}
    kept = {name: value for name, value in params.items() if name not in written}
    return {**kept, "messages": [], "extra_body": more}


async def _closing(
    stream: AsyncStream[ChatCompletionChunk],
) -> AsyncGenerator[ChatCompletionChunk, None]:
    """A stream whose connection ends with whoever reads it."""
    try:
        async for chunk in stream:
            yield chunk
    finally:
        await stream.close()


def _letters_of_calls(delta: ChoiceDelta | None) -> int:
    """Letters of calls of functions in a piece of an answer: all of it goes back to the server."""
    calls = (delta.tool_calls if delta else None) or []
    named = [call.function.name or "" for call in calls if call.function]
    given = [call.function.arguments or "" for call in calls if call.function]
    return sum(map(len, [*named, *given, *(call.id or "" for call in calls)]))


def rounds(messages: list[dict[str, Any]]) -> int:
    """How often functions were called since the visitor's last message."""
    count = 0
    for message in reversed(messages):
        if message["role"] == "user":
            break
        count += "tool_calls" in message
    return count
