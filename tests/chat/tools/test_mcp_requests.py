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
    async with asked_nothing(server.open()) as streams, ClientSession(*streams) as session:
        await session.initialize()
        with anyio.fail_after(30):
            while not any(getattr(one, "id", None) for one in server.answers):
                await anyio.sleep(0.01)
    assert [one.id for one in server.answers if getattr(one, "id", None)] == [104]
