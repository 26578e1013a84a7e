"""Leaves out what an MCP server asks of its client, and of answers what is not used here.

Imported only where mcp is.
"""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import anyio
from loguru import logger
from mcp.client import Transport
from mcp.shared.inbound import X_MCP_HEADER_KEY
from mcp.shared.message import SessionMessage
from mcp_types import METHOD_NOT_FOUND, ErrorData, JSONRPCError, JSONRPCRequest, JSONRPCResponse

PING = "ping"
ASKING = ("inputRequests", "requestState")
"""What an answer holds that asks for more instead, in versions of the protocol without sessions."""
LONGEST_TYPE = 40
MOST_HEADERS, LONGEST_NAME = 64, 256
"""Arguments of a function that go into headers, and letters of a name in its schema if any do."""


@asynccontextmanager
async def asked_nothing(transport: Transport, where: str) -> AsyncIterator[tuple[Any, Any]]:
    """A connection by which nothing is asked of the client but whether it is there.

    This client offers servers nothing that they could ask for: neither samples nor roots nor
    questions to a user. The SDK would compare a request with all kinds of them before it says no,
    and keep its complaints, tens of megabytes of 12 kB, until that is sent. The same holds of an
    answer that asks, and of what is not text in the answer to a call.

    Args:
        transport: The connection as the SDK opens it.
        where: The server, as the log calls it.
    """
    async with transport as (reading, writing):
        yield _Answers(reading, where), writing


class _Answers:
    """A stream of messages without the requests among them, and of their answers the words."""

    def __init__(self, stream: Any, where: str):
        self._stream, self._where = stream, where

    @property
    def last_context(self) -> Any:
        """What the SDK notes of the sender of the last message."""
        return getattr(self._stream, "last_context", None)

    async def receive(self) -> SessionMessage | Exception:
        """The next message.

        Raises:
            anyio.EndOfStream: If there is none.
        """
        while _asks(message := await self._stream.receive()):
            pass
        return _in_words(message, self._where)

    async def aclose(self) -> None:
        """Closes the stream."""
        await self._stream.aclose()

    def __aiter__(self) -> "_Answers":
        return self

    async def __anext__(self) -> SessionMessage | Exception:
        try:
            return await self.receive()
        except anyio.EndOfStream as end:
            raise StopAsyncIteration from end

    async def __aenter__(self) -> "_Answers":
        await self._stream.__aenter__()
        return self

    async def __aexit__(self, *error: Any) -> bool | None:
        return await self._stream.__aexit__(*error)


def _asks(message: SessionMessage | Exception) -> bool:
    if isinstance(message, Exception) or not isinstance(message.message, JSONRPCRequest):
        return False
    return message.message.method != PING


def _in_words(message: SessionMessage | Exception, where: str) -> SessionMessage | Exception:
    """The message; an answer to a call with its words alone, one that asks as an error."""
    if isinstance(message, Exception) or not isinstance(message.message, JSONRPCResponse):
        return message
    answer = message.message
    result = answer.result
    if result.get("resultType") == "input_required" or any(key in result for key in ASKING):
        refusal = ErrorData(code=METHOD_NOT_FOUND, message="it asks this client for something")
        return replace(message, message=JSONRPCError(jsonrpc="2.0", id=answer.id, error=refusal))
    if isinstance(result.get("tools"), list):
        told = JSONRPCResponse(jsonrpc="2.0", id=answer.id, result=_listed(result, where))
        return replace(message, message=told)
    content = result.get("content")
    if not isinstance(content, list):
        return message
    text = "\n".join(_words(part) for part in content)
    plain: dict[str, Any] = {"content": [{"type": "text", "text": text}]}
    plain |= {key: result[key] for key in ("isError", "resultType") if key in result}
    told = JSONRPCResponse(jsonrpc="2.0", id=answer.id, result=plain)
    return replace(message, message=told)


def _listed(result: dict[str, Any], where: str) -> dict[str, Any]:
    """A list of functions without further pages, and of each what is used here.

    Of every page the SDK keeps what it says of answers, and whenever a call is refused for its
    headers, it asks for up to a hundred of them.
    """
    kept = {key: result[key] for key in ("resultType", "ttlMs", "cacheScope") if key in result}
    told = [_told(tool) for tool in result["tools"]]
    tools = [tool for tool in told if tool is not None]
    if len(tools) < len(told):
        logger.warning(
            f"{where} wants more in headers of calls than is sent: {len(told) - len(tools)} of its "
            "functions are left out."
        )
    return kept | {"tools": tools}


def _told(tool: Any) -> Any:
    """What is used of a function's description; None for one with too many headers."""
    if not isinstance(tool, dict):
        return tool  # which the SDK refuses
    used = {key: tool[key] for key in ("name", "description", "inputSchema") if key in tool}
    return used if _has_few_headers(used.get("inputSchema")) else None


def _has_few_headers(schema: Any) -> bool:
    """Whether few arguments go into headers of a call, and none with a long name.

    For each of them the SDK writes the names of all that it is part of.
    """
    left, headers, longest = [schema], 0, 0
    while left:
        part = left.pop()
        if isinstance(part, dict):
            headers += X_MCP_HEADER_KEY in part
            longest = max(longest, *map(len, part), 0)
            left += part.values()
        elif isinstance(part, list):
            left += part
    return not headers or (headers <= MOST_HEADERS and longest <= LONGEST_NAME)


def _words(part: Any) -> str:
    """The text of a part of an answer; what else it is, such as a picture, is named."""
    kind = part.get("type") if isinstance(part, dict) else None
    if kind == "text" and isinstance(part.get("text"), str):
        return part["text"]
    return f"({kind[:LONGEST_TYPE]} left out)" if isinstance(kind, str) else "(left out)"
