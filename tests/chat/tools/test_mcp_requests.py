"""An MCP server asks nothing of its client but whether it is there."""

import contextlib

import anyio
import pytest

pytest.importorskip("mcp")


def message(method, params=None, number=1):
    from mcp.shared.message import SessionMessage
    from mcp_types import JSONRPCNotification, JSONRPCRequest

    if number is None:
        return SessionMessage(JSONRPCNotification(jsonrpc="2.0", method=method, params=params))
    request = JSONRPCRequest(jsonrpc="2.0", id=number, method=method, params=params)
    return SessionMessage(request)


class Scripted:
    """A connection on which a server sends what it is told, and answers how a session begins."""

    def __init__(self, sent):
        self._sent, self.answers = sent, []

    @contextlib.asynccontextmanager
    async def open(self):
        there, reading = anyio.create_memory_object_stream(100)
        writing, here = anyio.create_memory_object_stream(100)
        async with anyio.create_task_group() as group:
            group.start_soon(self._serve, there, here)
            yield reading, writing
            group.cancel_scope.cancel()

    async def _serve(self, there, here):
        from mcp.shared.message import SessionMessage
        from mcp_types import JSONRPCRequest, JSONRPCResponse

        server = {"name": "scripted", "version": "1"}
        async for item in here:
            if not isinstance(item.message, JSONRPCRequest):
                self.answers.append(item.message)
                continue
            asked = item.message
            result = {"protocolVersion": "2025-06-18", "capabilities": {}, "serverInfo": server}
            answer = JSONRPCResponse(jsonrpc="2.0", id=asked.id, result=result)
            await there.send(SessionMessage(answer))
            if asked.method == "initialize":
                for one in self._sent:
                    await there.send(one)


async def test_only_a_ping_is_answered():
    """The SDK made 58,505 complaints of such a request, and kept them until it could say so."""
    from mcp import ClientSession

    from ico3d.chat.tools.mcp_requests import asked_nothing

    asked = ("roots/list", "sampling/createMessage", "elicitation/create", "foo", "ping")
    wrong = {"maxTokens": 1, "messages": [{"role": "user", "content": [{}] * 3900}]}
    sent = [message(method, wrong, 100 + i) for i, method in enumerate(asked[:-1])]
    sent.append(message(asked[-1], number=104))
    sent.insert(2, message("notifications/tools/list_changed", number=None))
    server = Scripted(sent)
    async with (
        asked_nothing(server.open(), "tools.mcp.clock") as streams,
        ClientSession(*streams) as session,
    ):
        await session.initialize()
        with anyio.fail_after(30):
            while not any(getattr(one, "id", None) for one in server.answers):
                await anyio.sleep(0.01)
    assert [one.id for one in server.answers if getattr(one, "id", None)] == [104]


def answered(result):
    from mcp.shared.message import SessionMessage
    from mcp_types import JSONRPCResponse

    return SessionMessage(JSONRPCResponse(jsonrpc="2.0", id=7, result=result))


async def received(*messages):
    """What comes through of messages."""
    from ico3d.chat.tools.mcp_requests import asked_nothing

    @contextlib.asynccontextmanager
    async def transport():
        there, reading = anyio.create_memory_object_stream(100)
        for one in messages:
            await there.send(one)
        there.close()
        yield reading, None

    async with asked_nothing(transport(), "tools.mcp.clock") as (reading, _):
        return [item.message async for item in reading]


async def test_of_an_answer_to_a_call_the_words_come_through():
    content = [
        {"type": "text", "text": "ten"},
        {"type": "image", "data": "A" * 1000, "mimeType": "image/png"},
        {"type": "text", "text": ["no words"]},
        {"type": "x" * 100},
        {},
        7,
    ]
    rest = {"structuredContent": {"a": [{}] * 3900}, "_meta": {}, "isError": True}
    (told,) = await received(answered({"content": content, **rest}))
    words = "ten\n(image left out)\n(text left out)\n(%s left out)\n(left out)\n(left out)"
    assert told.id == 7
    assert told.result == {
        "content": [{"type": "text", "text": words % ("x" * 40)}],
        "isError": True,
    }


@pytest.mark.parametrize(
    "asking",
    [
        {"resultType": "input_required"},
        {"inputRequests": {"a": {"method": "roots/list"}}},
        {"requestState": "x"},
    ],
)
async def test_an_answer_that_asks_is_a_refused_one(asking):
    """Within its result a server may ask for samples, of which the SDK makes 58,513 complaints."""
    wrong = {"maxTokens": 1, "messages": [{"role": "user", "content": [{}] * 3900}]}
    (told,) = await received(answered({"content": [{}] * 3900, "more": wrong, **asking}))
    assert (told.id, told.error.message) == (7, "it asks this client for something")


async def test_other_answers_come_through_as_they_are():
    tools = {"tools": [{"name": "now", "inputSchema": {"type": "object"}}]}
    (told,) = await received(answered(tools))
    assert told.result == tools


async def test_of_a_list_of_functions_comes_through_what_is_used():
    """The SDK keeps what pages say of answers, and asks for many of them at a refused call."""
    about = {"name": "now", "description": "The time.", "inputSchema": {"type": "object"}}
    rest = {"outputSchema": {"a": "x" * 1000}, "icons": [{}] * 100, "_meta": {}, "title": "Now"}
    page = {"nextCursor": "2", "ttlMs": 5, "cacheScope": "private", "resultType": "complete"}
    (told,) = await received(answered({"tools": [about | rest, about], "_meta": {}, **page}))
    del page["nextCursor"]
    assert told.result == {"tools": [about, about], **page}


@pytest.mark.parametrize(
    ("long", "headers", "comes"),
    [(256, 64, True), (257, 1, False), (1, 65, False), (1000, 0, True)],
)
async def test_a_function_with_many_headers_or_long_names_is_left_out(long, headers, comes):
    """Names of 900,000 letters above 2,600 headers took 2.5 GB and 6 s of all others."""
    leaves = {f"p{n}": {"type": "string", "x-mcp-header": f"h{n}"} for n in range(headers)}
    schema = {"type": "object", "properties": {"x" * long: {"properties": leaves}}}
    tools = [{"name": "odd", "inputSchema": schema}, {"name": "now", "inputSchema": {}}]
    (told,) = await received(answered({"tools": tools}))
    assert [tool["name"] for tool in told.result["tools"]] == ["odd"] * comes + ["now"]


def test_what_breaks_the_protocol_is_said_in_a_few_words():
    from mcp_types import ListToolsResult
    from pydantic import ValidationError

    from ico3d.chat.settings.mcp import McpServer
    from ico3d.chat.tools.mcp import Connection

    with pytest.raises(ValidationError) as caught:
        ListToolsResult.model_validate({"tools": [{}] * 5000})
    said = Connection(McpServer("clock", url="http://127.0.0.1:1/mcp")).told(caught.value)
    assert said == "it does not keep to the protocol"
    told = Connection(McpServer("clock", url="http://127.0.0.1:1/mcp")).told
    assert told(OSError("\x1b[2J well\n\u202e.")) == r"\x1b[2J well \u202e"
