"""The interface of providers of recognition, language and voice."""

import importlib.util
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.bundle.animation import Animation
from ico3d.bundle.manifest import HeadInfo
from ico3d.bundle.persona import Persona
from ico3d.chat.settings.keys import OPENAI_KEY, key_for
from ico3d.common.weights import model_of
from ico3d.errors import MissingModelError, SettingsError

IN_FILE = " in a settings file (--settings FILE)"
"""Where a table of settings stands that a sentence names."""


@runtime_checkable
class WarmsUp(Protocol):
    """A service whose first answer is slow."""

    async def warm_up(self) -> None:
        """Requests an answer before visitors come."""
        ...


@dataclass(frozen=True)
class Context:
    """The avatar for which a service is created.

    Attributes:
        persona: Who the avatar is.
        head: Sizes of the baked head.
        animation: Procedural motion of the body; None for a head alone.
        gestures: Meanings of the gestures that the body makes when a visitor asks for one.
    """

    persona: Persona
    head: HeadInfo
    animation: Animation | None
    gestures: tuple[str, ...] = ()


def unhindered(settings: Any) -> str:
    """The `hindrance` of providers that always work."""
    del settings
    return ""


def lacks_package(package: str, extra: str) -> str:
    """A sentence if a package is not installed, else empty."""
    if importlib.util.find_spec(package) is not None:
        return ""
    return f"{package} is not installed: pip install 'ico3d[{extra}]'."


def lacks_weights(name: str) -> str:
    """A sentence if weights are not installed, else empty."""
    try:
        model_of(name)
    except MissingModelError as error:
        return str(error)
    return ""


def nothing(settings: Any) -> str:
    """The `detail` of providers whose title says everything."""
    del settings
    return ""


def lacks_server(url: str, key_variable: str, kind: str) -> str:
    """A sentence if no server is named or its key is missing, else empty."""
    if not url and not os.environ.get(key_variable or OPENAI_KEY):
        return f'no server is chosen: set [{kind}] use = "openai" and url{IN_FILE}.'
    try:
        key_for(url, key_variable, f"[{kind}]")
    except SettingsError as error:
        return str(error)
    return ""


@dataclass(frozen=True)
class Provider:
    """One way to provide a service; an entry in the table of its kind.

    Attributes:
        title: Name, as shown to visitors.
        settings: Dataclass of the options.
        make: Creates the processor of one session from options and context; may take a while and
            runs in a thread. Large read-only data are shared between sessions.
        hindrance: Returns one sentence on what prevents the service from working with these options
            (packages, weights, a server) and what would help; empty if it works. Fast, and never
            raises.
        stand_in: Whether this is one of the three simple offline services.
        detail: Returns the model that the options mean, as shown to visitors.
    """

    title: str
    settings: type
    make: Callable[[Any, Context], FrameProcessor]
    hindrance: Callable[[Any], str] = unhindered
    stand_in: bool = False
    detail: Callable[[Any], str] = nothing


Table = dict[str, Provider]
"""Providers of one kind by name, the preferred one first."""
