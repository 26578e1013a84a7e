"""A language module in front of a model that calls functions: the calls are the client's."""

import json

import openai
from starlette.requests import Request
from starlette.responses import StreamingResponse

from ico3d.bundle.manifest import Persona
from ico3d.chat.services.language import openai as language
from ico3d.chat.services.provider import Context
from support.chat.remote import service_app, serving

WAVE = {
    "type": "function",
    "function": {
        "name": "gesture",
        "description": "Moves.",
        "parameters": {
            "type": "object",
            "properties": {"name": {"type": "string", "enum": ["wave"]}},
            "required": ["name"],
        },
    },
}
MESSAGES = [
    {"role": "system", "content": "You are Bob."},
    {"role": "user", "content": "Say hello!"},
]
CALL = {
    "index": 0,
    "id": "call_1",
    "type": "function",
    "function": {"name": "gesture", "arguments": '{"name": "wave"}'},
}


class Model:
    """A server whose model calls a function, and says something where it may not."""

    def __init__(self):
        self.asked = []

    async def __call__(self, scope, receive, send):
        if scope["type"] == "http":
            self.asked.append(await Request(scope, receive).json())
            delta = {"tool_calls": [CALL]} if self.asked[-1].get("tools") else {"content": "Hi."}
            await StreamingResponse(self.events(delta), media_type="text/event-stream")(
                scope, receive, send
            )

    async def events(self, delta):
        head = {"id": "1", "object": "chat.completion.chunk", "created": 1, "model": "m"}
        for choice in ({"delta": delta}, {"delta": {}, "finish_reason": "stop"}):
            yield f"data: {json.dumps({**head, 'choices': [{'index': 0, **choice}]})}\n\n"
        yield "data: [DONE]\n\n"


async def test_calls_of_functions_are_left_to_the_client():
    model = Model()
    persona = Persona("Ada", "", ("who are you => I am Ada.",))
    async with serving(model) as upstream:
        settings = language.Settings(f"{upstream}v1", "m")
        app = service_app("language", lambda: language.make(settings, Context(persona, None, None)))
        async with serving(app) as url:
            sdk = openai.AsyncOpenAI(base_url=f"{url}v1", api_key="none", max_retries=0)
            create = sdk.chat.completions.create
            said = await create(model="m", messages=MESSAGES, temperature=0.25, max_tokens=9)
            assert said.choices[0].message.content == "Hi."
            called = (await create(model="m", messages=MESSAGES, tools=[WAVE])).choices[0]
            stream = await create(model="m", messages=MESSAGES, tools=[WAVE], stream=True)
            chunks = [chunk.choices[0] async for chunk in stream]
    assert called.finish_reason == "tool_calls" and called.message.content is None
    for call in (called.message.tool_calls[0], chunks[0].delta.tool_calls[0]):
        assert (call.id, call.function.name) == ("call_1", "gesture")
        assert json.loads(call.function.arguments) == {"name": "wave"}
    assert chunks[-1].finish_reason == "tool_calls"
    first, second = model.asked[0], model.asked[1]
    assert first["messages"] == MESSAGES  # the module's own persona does not speak in between
    assert (first["temperature"], first["max_tokens"]) == (0.25, 9)
    assert second["tools"][0]["function"] == WAVE["function"]
