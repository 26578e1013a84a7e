"""Functions for the language model: moving the avatar, and users' tools."""

import importlib.util

from loguru import logger
from pipecat.adapters.llm.schemas.function_schema import FunctionSchema
from pipecat.adapters.llm.schemas.tools_schema import ToolsSchema
from pipecat.processors.aggregators.llm_context import NOT_GIVEN, NotGiven
from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.performing.cueing import Cueing
from ico3d.chat.performing.gestures import Gestures
from ico3d.chat.performing.moods import Moods
from ico3d.chat.settings.headers import filled_in
from ico3d.chat.settings.mcp import McpServer
from ico3d.chat.settings.tools import Tool
from ico3d.chat.tools.body import Said, gesture_function, mood_function
from ico3d.chat.tools.http import http_function
from ico3d.errors import MissingExtraError


def functions(
    language: FrameProcessor,
    gestures: Gestures | Cueing | None,
    moods: Moods | None,
    tools: tuple[Tool, ...],
    allow: tuple[str, ...],
) -> ToolsSchema | NotGiven:
    """The functions of one session.

    Args:
        language: The language model that calls them.
        gestures: Gestures of the body; None without a body.
        moods: Moods of the brows; None if the head has no inputs for brows.
        tools: The user's tools.
        allow: Hosts that tools may call.
    """
    said = Said([moved.forget for moved in (moods, gestures) if moved is not None])
    said.watch(language)
    found = [http_function(tool, allow) for tool in tools]
    if moods is not None:
        found.append(mood_function(moods, said))
    if gestures is not None and gestures.names:
        found.append(gesture_function(gestures, said))
    return ToolsSchema(found) if found else NOT_GIVEN


def extended(tools: ToolsSchema | NotGiven, found: list[FunctionSchema]) -> ToolsSchema:
    """Functions and further ones; of two with the same name the earlier one stays."""
    known = [] if isinstance(tools, NotGiven) else list(tools.standard_tools)
    for function in found:
        if function.name in [other.name for other in known]:
            logger.warning(f"chat settings: there are two functions {function.name!r}.")
        else:
            known.append(function)
    return ToolsSchema(known)


def check_ready(tools: tuple[Tool, ...], servers: tuple[McpServer, ...]) -> None:
    """Checks what can be checked before visitors come: packages, and the environment's keys.

    Raises:
        MissingExtraError: If there are MCP servers and their package is not installed.
        SettingsError: If an environment variable is not set.
    """
    for tool in tools:
        filled_in(tool.headers, tool.where)
    for server in servers:
        filled_in(server.secrets, server.where)
    if servers and importlib.util.find_spec("mcp") is None:
        raise MissingExtraError("mcp", "mcp", "calling functions of MCP servers")
