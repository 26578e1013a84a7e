"""Functions of MCP servers, of which each visitor has connections of their own.

So a server that remembers its client cannot mix visitors up. Whatever fails becomes one sentence
for the model, and the next call connects anew.
"""

import asyncio
import json
import os
import re
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from loguru import logger
from pipecat.adapters.llm.schemas.function_schema import FunctionSchema
from pipecat.services.llm_service import FunctionCallParams
from pydantic import ValidationError

from ico3d.chat.settings.headers import blanked, filled_in
from ico3d.chat.settings.mcp import McpServer
from ico3d.chat.tools.http import MOST_BYTES
from ico3d.chat.wire.characters import sendable
from ico3d.errors import Ico3dError, printable

if TYPE_CHECKING:
    from mcp import Client
    from mcp_types import CallToolResult, Tool

LONGEST_NAME = 64  # that models accept for a function
LONGEST_COMPLAINT = 200
LONGEST_END = 10.0  # s in which a connection ends: a program is asked twice, and killed after 4
MOST_FUNCTIONS = 64  # of a server: all their descriptions are part of every question
MOST_LETTERS = 64 * 1024  # of all descriptions of a server, with what they say of arguments

Offer = Callable[[list[FunctionSchema]], None]


class Connections:
    """A visitor's connections to all servers."""

    def __init__(self, servers: tuple[McpServer, ...], offer: Offer):
        """Starts unconnected.

        Args:
            servers: The servers.
            offer: Called with the functions of a server once it is connected.
        """
        self._connections = [Connection(server) for server in servers]
        self._offer = offer
        self._tasks: list[asyncio.Task[None]] = []

    def open(self) -> None:
        """Connects in the background: a slow server keeps nobody waiting."""
        self._tasks = [asyncio.create_task(self._ask(one)) for one in self._connections]

    async def close(self) -> None:
        """Ends all connections, and the programs behind them."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await asyncio.gather(*(one.close() for one in self._connections))

    async def _ask(self, connection: "Connection") -> None:
        try:
            functions = await connection.functions()
        except Exception as error:
            logger.warning(f"{connection.server.where} offers nothing: {connection.told(error)}.")
        else:
            self._offer(functions)


@dataclass
class _Line:
    """An open line to a server: its client, and the task that holds both."""

    closing: asyncio.Event = field(default_factory=asyncio.Event)
    opened: "asyncio.Future[Client]" = field(
        default_factory=lambda: asyncio.get_running_loop().create_future()
    )
    task: asyncio.Task[None] | None = None


def _size(function: FunctionSchema) -> int | None:
    """Letters of what a model is told of a function; None where it cannot be told."""
    told = [function.name, function.description, function.properties, function.required]
    try:
        return len(json.dumps(told, allow_nan=False))
    except (ValueError, TypeError, RecursionError):
        return None


class Connection:
    """A connection to one server, opened by the first use and again after it was lost."""

    def __init__(self, server: McpServer):
        """Starts unconnected."""
        self.server = server
        self._line: _Line | None = None

    async def functions(self) -> list[FunctionSchema]:
        """The functions that the server offers and the settings permit.

        Raises:
            Exception: Whatever the server or the way to it does not do.
        """
        async with asyncio.timeout(self.server.seconds):
            listed = await (await self._client()).list_tools()
        wanted = self.server.functions
        chosen = [tool for tool in listed.tools if not wanted or tool.name in wanted]
        return self._readable([self._function(tool) for tool in chosen[:MOST_FUNCTIONS]])

    def _readable(self, functions: list[FunctionSchema]) -> list[FunctionSchema]:
        """Those that can be told to a model with every question; the log names the others."""
        kept: list[FunctionSchema] = []
        left: list[str] = []
        room = MOST_LETTERS
        for function in functions:
            size = _size(function)
            if size is None or size > room:
                left.append(function.name)
                continue
            kept.append(function)
            room -= size
        if left:
            names = ", ".join(left)[:LONGEST_COMPLAINT]
            logger.warning(
                f"{self.server.where} tells more of its functions than a model reads, or what "
                f"cannot be written as JSON: without {names}."
            )
        return kept

    async def call(self, name: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Calls a function: returns `result`, or `error` in one sentence for the model."""
        try:
            async with asyncio.timeout(self.server.seconds):
                client = await self._client()
                result = await client.call_tool(name, dict(arguments))
        except Exception as error:
            if is_lost(error):
                await self.close()
            return {"error": f"{name} failed: {self.told(error)}."}
        text = blanked(sendable(text_of(result)), self.server.secrets, self.server.where)
        if len(text.encode()) > MOST_BYTES:
            return {"error": f"{name} failed: its answer has more than {MOST_BYTES} bytes."}
        if result.is_error:
            said = " ".join(text.split()).rstrip(".")[:LONGEST_COMPLAINT]
            return {"error": f"{name} failed: {said}."}
        return {"result": text}

    async def close(self) -> None:
        """Ends the connection, and the program behind it."""
        line, self._line = self._line, None
        if line is not None and line.task is not None:
            line.closing.set()
            if not line.opened.done():
                line.task.cancel()
            await asyncio.wait([line.task], timeout=LONGEST_END)
            if not line.task.done():
                line.task.cancel()
                await asyncio.wait([line.task], timeout=LONGEST_END)
            if not line.task.done():
                logger.warning(f"{self.server.where} does not let go of its connection.")

    def told(self, error: BaseException) -> str:
        """What went wrong, in part of a sentence without keys."""
        if isinstance(error, TimeoutError):
            return f"it did not answer within {self.server.seconds:g} seconds"
        while isinstance(error, BaseExceptionGroup):  # of the tasks of a connection
            error = error.exceptions[0]
        if isinstance(error, ValidationError):  # in full it may have millions of letters
            return "it does not keep to the protocol"
        said = printable(" ".join(str(error).split())).rstrip(".") or type(error).__name__
        return blanked(said, self.server.secrets, self.server.where)[:LONGEST_COMPLAINT]

    def _function(self, tool: "Tool") -> FunctionSchema:
        async def call(params: FunctionCallParams) -> None:
            await params.result_callback(await self.call(tool.name, params.arguments))

        name = re.sub(r"[^A-Za-z0-9_-]", "_", f"{self.server.name}_{tool.name}")[:LONGEST_NAME]
        schema = tool.input_schema
        about = blanked(tool.description or tool.name, self.server.secrets, self.server.where)
        properties, required = schema.get("properties", {}), schema.get("required", [])
        return FunctionSchema(name, about, properties, required, call)

    async def _client(self) -> "Client":
        """The client of an open line; opens one if there is none."""
        if self._line is None or (self._line.task and self._line.task.done()):
            self._line = line = _Line()
            line.task = asyncio.create_task(self._hold(line))
        return await asyncio.shield(self._line.opened)

    async def _hold(self, line: _Line) -> None:
        """Holds a line from its beginning to its end, which have to be in one task."""
        try:
            opened = over_http if self.server.url else as_program
            async with opened(self.server) as client:
                line.opened.set_result(client)
                await line.closing.wait()
        except Exception as error:
            if not line.opened.done():
                line.opened.set_exception(error)
        finally:
            line.opened.cancel()
            with suppress(asyncio.CancelledError, Exception):
                line.opened.exception()  # taken, else asyncio complains of it


@asynccontextmanager
async def over_http(server: McpServer) -> AsyncIterator["Client"]:
    """A client of a server at an address.

    Redirects stay there, as the SDK has it, and nothing goes through a proxy.

    Raises:
        SettingsError: If an environment variable is not set.
        Exception: If the server cannot be reached.
    """
    import httpx2
    from mcp import Client
    from mcp.client.streamable_http import streamable_http_client

    from ico3d.chat.services.bounded import NoCookies
    from ico3d.chat.tools.bounded_http import BoundedTransport
    from ico3d.chat.tools.mcp_requests import asked_nothing

    headers = filled_in(server.headers, server.where)
    limits = httpx2.Timeout(server.seconds, read=None)  # a stream is silent between calls
    sending = BoundedTransport(server.seconds, trust_env=False)
    async with (
        httpx2.AsyncClient(
            headers=headers,
            timeout=limits,
            trust_env=False,
            transport=sending,
            cookies=NoCookies(),
        ) as http,
        Client(
            asked_nothing(streamable_http_client(server.url, http_client=http), server.where)
        ) as client,
    ):
        yield unvalidated(client)


@asynccontextmanager
async def as_program(server: McpServer) -> AsyncIterator["Client"]:
    """A client of a server that is a program, which runs as long.

    Raises:
        SettingsError: If an environment variable is not set.
        Exception: If the program does not start.
    """
    from mcp import Client, StdioServerParameters
    from mcp.client.stdio import stdio_client

    from ico3d.chat.tools.mcp_requests import asked_nothing

    environment = filled_in(server.environment, server.where)
    command, *arguments = server.command
    parameters = StdioServerParameters(command=command, args=arguments, env=environment)
    with Path(os.devnull).open("w") as nowhere:  # what it says there may quote visitors and keys
        line = asked_nothing(stdio_client(parameters, errlog=nowhere), server.where)
        async with Client(line) as client:
            yield unvalidated(client)


def unvalidated(client: "Client") -> "Client":
    """The client, which compares no answer with the schema that its server states.

    Only the text of answers counts here, and the server's own patterns may take for ever, while
    nothing else is done.
    """

    async def as_it_is(name: str, result: "CallToolResult") -> None:
        del name, result

    client.session.validate_tool_result = as_it_is
    return client


def text_of(result: "CallToolResult") -> str:
    """The words of an answer, of which `mcp_requests` lets nothing else through."""
    return "\n".join(part.text for part in result.content if part.type == "text")


def is_lost(error: Exception) -> bool:
    """Whether an error ended the connection, rather than the one call."""
    from mcp import MCPError
    from mcp_types import CONNECTION_CLOSED, INVALID_REQUEST

    if isinstance(error, TimeoutError | Ico3dError):
        return False
    return not isinstance(error, MCPError) or error.code in (CONNECTION_CLOSED, INVALID_REQUEST)
