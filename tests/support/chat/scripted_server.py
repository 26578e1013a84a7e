"""An OpenAI-compatible server over real HTTP that says what a test wants."""

import asyncio
import contextlib
import json
from dataclasses import dataclass, field

import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse, StreamingResponse

from ico3d.chat.serving import server


@dataclass(frozen=True)
class Call:
    """A function call of the model."""

    name: str
    arguments: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Thought:
    """What the server gives apart from the text."""

    text: str
    field: str = "reasoning_content"


class Script:
    """What a server answers, and what it was asked.

    Attributes:
        answer: From a request's body to a list of texts, `Thought`s, `Call`s and pauses in seconds;
            or to a number, the status of a refusal.
        requests: Bodies of the chat requests.
        abandoned: Streams whose reader hung up.
        models: Names that it offers.
        keys: Authorization headers.
        refusal: What it says beside a status that is no answer.
    """

    def __init__(self, answer=lambda body: ["All right."], models=("tiny",)):
        self.answer, self.models = answer, models
        self.requests, self.keys, self.abandoned = [], [], 0
        self.refusal = "tools are not supported"

    def app(self):
        app = FastAPI()

        @app.get("/v1/models")
        async def models():
            return {"object": "list", "data": [{"id": name} for name in self.models]}

        @app.post("/v1/chat/completions")
        async def chat(request: Request):
            body = await request.json()
            self.requests.append(body)
            self.keys.append(request.headers.get("authorization"))
            parts = self.answer(body)
            if isinstance(parts, int):
                return JSONResponse({"error": {"message": self.refusal}}, parts)
            if not body.get("stream"):
                return whole("".join(part for part in parts if isinstance(part, str)))
            return StreamingResponse(self.stream(parts), media_type="text/event-stream")

        return app

    async def stream(self, parts):
        calls = 0
        try:
            for part in parts:
                if isinstance(part, float):
                    await asyncio.sleep(part)
                elif isinstance(part, Call):
                    yield chunk({"tool_calls": [tool_call(part, calls)]})
                    calls += 1
                elif isinstance(part, Thought):
                    yield chunk({part.field: part.text})
                else:
                    yield chunk({"content": part})
            yield chunk({}, "tool_calls" if calls else "stop")
            yield "data: [DONE]\n\n"
        except (GeneratorExit, asyncio.CancelledError):
            self.abandoned += 1
            raise


def chunk(delta, finish=None):
    choice = {"index": 0, "delta": {"role": "assistant", **delta}, "finish_reason": finish}
    value = {"id": "1", "object": "chat.completion.chunk", "created": 0, "model": "tiny"}
    return f"data: {json.dumps({**value, 'choices': [choice]})}\n\n"


def tool_call(call, index):
    function = {"name": call.name, "arguments": json.dumps(call.arguments)}
    return {"index": index, "id": f"call-{index}", "type": "function", "function": function}


def whole(text):
    message = {"role": "assistant", "content": text}
    choice = {"index": 0, "message": message, "finish_reason": "stop"}
    value = {"id": "1", "object": "chat.completion", "created": 0, "model": "tiny"}
    return {**value, "choices": [choice]}


@contextlib.asynccontextmanager
async def running(app):
    """Yields the port of an application that runs in the test's own loop."""
    listener = server.bind("127.0.0.1", 0)
    config = uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=1)
    uvicorn_server = uvicorn.Server(config)
    task = asyncio.create_task(uvicorn_server.serve(sockets=[listener]))
    while not uvicorn_server.started:
        await asyncio.sleep(0.01)
    try:
        yield listener.getsockname()[1]
    finally:
        uvicorn_server.should_exit = True
        await task
