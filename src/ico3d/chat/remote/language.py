"""`POST /v1/chat/completions`: a conversation in, the next answer out, streamed or whole."""

import contextlib
import json
import secrets
import time
from collections.abc import AsyncGenerator
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse, StreamingResponse
from pipecat.adapters.llm.schemas.function_schema import FunctionSchema
from pipecat.frames.frames import (
    Frame,
    FunctionCallsStartedFrame,
    LLMContextFrame,
    LLMTextFrame,
    LLMThoughtTextFrame,
    LLMUpdateSettingsFrame,
)
from pipecat.processors.aggregators.llm_context import NOT_GIVEN, LLMContext
from pipecat.services.llm_service import FunctionCallParams
from pipecat.services.settings import LLMSettings
from pydantic import BaseModel, Field, field_validator

from ico3d.chat.remote.asked import asked
from ico3d.chat.remote.headless import Spares, run
from ico3d.errors import ServiceError

THOUGHTS = "reasoning_content"
MOST_MESSAGES, MOST_TOOLS = 10_000, 128  # of a request: each is looked at in the loop of everybody
SAMPLING = ("temperature", "top_p", "max_tokens", "seed", "frequency_penalty", "presence_penalty")


class Function(BaseModel):
    """A function that the model may call; `parameters` is the JSON schema of an object."""

    name: str
    description: str = ""
    parameters: dict[str, Any] = {}


class Tool(BaseModel):
    """A function as the OpenAI API wraps it."""

    function: Function


class ChatRequest(BaseModel):
    """A conversation to continue; other fields, such as the model's name, are ignored."""

    # of ten thousand that are none, each would be told: 0.1 s for 30 kB
    messages: list[dict[str, Any]] = Field(min_length=1, max_length=MOST_MESSAGES, fail_fast=True)
    stream: bool = False
    tools: list[Tool] = Field(default=[], max_length=MOST_TOOLS)
    temperature: float | None = None
    top_p: float | None = None
    max_tokens: int | None = None
    max_completion_tokens: int | None = None
    seed: int | None = None
    frequency_penalty: float | None = None
    presence_penalty: float | None = None

    @field_validator("messages")
    @classmethod
    def _have_content(cls, messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
        for content in (message.get("content") for message in messages):
            parts = content if isinstance(content, list) else []
            if not (content is None or isinstance(content, str | list)):
                raise ValueError("content must be a text, or a list of parts.")
            if not all(isinstance(part, dict) for part in parts):
                raise ValueError("each part of content must be an object.")
        return messages


def add_routes(app: FastAPI, name: str, spares: Spares, seconds: float) -> None:
    """Adds the route to an application.

    Args:
        app: The application.
        name: Name of the model in answers.
        spares: Creates language models.
        seconds: Time limit of a request.
    """

    @app.post("/v1/chat/completions")
    async def completions(sent: Request) -> Response:
        request = await asked(sent, ChatRequest)
        deltas = answered(request, spares, seconds)
        if not request.stream:
            return JSONResponse(_whole(name, [delta async for delta in deltas]))
        first = await anext(deltas)  # an error is still an answer here
        return StreamingResponse(_events(name, first, deltas), media_type="text/event-stream")


async def answered(
    request: ChatRequest, spares: Spares, seconds: float
) -> AsyncGenerator[dict[str, Any], None]:
    """Yields the answer as the API's deltas: `content`, `tool_calls`, or `reasoning_content`.

    Raises:
        ServiceError: If the model fails or has no answer.
        TimeoutError: If the time limit is exceeded.
    """
    given = {name: value for name in SAMPLING if (value := getattr(request, name)) is not None}
    if request.max_completion_tokens is not None:
        given["max_tokens"] = request.max_completion_tokens
    frames: list[Frame] = [
        # who it is comes with the messages
        LLMUpdateSettingsFrame(delta=LLMSettings(system_instruction=None, **given)),
        LLMContextFrame(LLMContext(list(request.messages), _tools(request.tools))),  # type: ignore[arg-type]
    ]
    silent = True
    async with contextlib.aclosing(run(await spares.take(), frames, seconds)) as made:
        async for frame in made:
            delta = _delta(frame)
            if delta is not None:
                silent = silent and THOUGHTS in delta
                yield delta
    if silent:
        raise ServiceError("the model gave no answer.")


def _tools(tools: list[Tool]) -> Any:
    if not tools:
        return NOT_GIVEN
    return [
        FunctionSchema(
            tool.function.name,
            tool.function.description,
            tool.function.parameters.get("properties", {}),
            tool.function.parameters.get("required", []),
            handler=_left_to_the_client,
        )
        for tool in tools
    ]


async def _left_to_the_client(call: FunctionCallParams) -> None:
    await call.result_callback(None)


def _delta(frame: Frame) -> dict[str, Any] | None:
    if isinstance(frame, LLMTextFrame) and frame.text:
        return {"content": frame.text}
    if isinstance(frame, LLMThoughtTextFrame):
        return {THOUGHTS: frame.text}  # empty for a mere sign of life
    if not isinstance(frame, FunctionCallsStartedFrame):
        return None
    calls = [
        {
            "index": index,
            "id": call.tool_call_id,
            "type": "function",
            "function": {"name": call.function_name, "arguments": json.dumps(call.arguments)},
        }
        for index, call in enumerate(frame.function_calls)
    ]
    return {"tool_calls": calls}


async def _events(
    name: str, first: dict[str, Any], deltas: AsyncGenerator[dict[str, Any], None]
) -> AsyncGenerator[str, None]:
    """The server-sent events of a streamed answer."""
    head = _head(name, "chat.completion.chunk")
    reason = "tool_calls" if "tool_calls" in first else "stop"
    async with contextlib.aclosing(deltas):
        yield _event(head, {"role": "assistant", **first})
        async for delta in deltas:
            reason = "tool_calls" if "tool_calls" in delta else reason
            yield _event(head, delta)
    yield _event(head, {}, reason)
    yield "data: [DONE]\n\n"


def _event(head: dict[str, Any], delta: dict[str, Any], reason: str | None = None) -> str:
    choice = {"index": 0, "delta": delta, "finish_reason": reason}
    return f"data: {json.dumps({**head, 'choices': [choice]}, ensure_ascii=False)}\n\n"


def _whole(name: str, deltas: list[dict[str, Any]]) -> dict[str, Any]:
    """An answer at once."""
    calls = [
        {key: value for key, value in call.items() if key != "index"}
        for delta in deltas
        for call in delta.get("tool_calls", [])
    ]
    text = "".join(delta.get("content", "") for delta in deltas)
    message: dict[str, Any] = {"role": "assistant", "content": text or None}
    if thoughts := "".join(delta.get(THOUGHTS, "") for delta in deltas):
        message[THOUGHTS] = thoughts
    if calls:
        message["tool_calls"] = calls
    choice = {"index": 0, "message": message, "finish_reason": "tool_calls" if calls else "stop"}
    return {**_head(name, "chat.completion"), "choices": [choice]}


def _head(name: str, kind: str) -> dict[str, Any]:
    return {
        "id": f"chatcmpl-{secrets.token_hex(12)}",
        "object": kind,
        "created": int(time.time()),
        "model": name,
    }
