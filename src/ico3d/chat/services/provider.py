"""What a provider of recognition, language or voice is."""

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


@runtime_checkable
class WarmsUp(Protocol):
    """A service that is quicker once it has answered."""

    async def warm_up(self) -> None:
        """Asks for something before visitors come."""
        ...


@dataclass(frozen=True)
class Context:
    """Whom a service works for.

    Attributes:
        persona: Who the avatar is.
        head: What its face can do.
        animation: How its body can move; None for a head alone.
    """

    persona: Persona
    head: HeadInfo
    animation: Animation | None


def unhindered(settings: Any) -> str:
    """For providers that need nothing beyond what `make` says is missing."""
    del settings
    return ""


def lacks_package(package: str, extra: str) -> str:
    """What hinders a provider that needs a package: nothing, or that it is not installed."""
    if importlib.util.find_spec(package) is not None:
        return ""
    return f"{package} is not installed: pip install 'ico3d[{extra}]'."


def lacks_weights(name: str) -> str:
    """What hinders a provider that needs weights: nothing, or that they are not here."""
    try:
        model_of(name)
    except MissingModelError as error:
        return str(error)
    return ""


def nothing(settings: Any) -> str:
    """For providers whose title says all."""
    del settings
    return ""


def lacks_server(url: str, key_variable: str, kind: str) -> str:
    """What hinders a provider that asks a server: none is named, or its key is not here."""
    if not url and not os.environ.get(key_variable or OPENAI_KEY):
        return f'no server is chosen: set [{kind}] use = "openai" and url.'
    try:
        key_for(url, key_variable, f"[{kind}]")
    except SettingsError as error:
        return str(error)
    return ""


@dataclass(frozen=True)
class Provider:
    """One way to do a job; an entry in the table of its kind.

    Attributes:
        title: For the visitor's eyes.
        settings: Dataclass of its options.
        make: Makes the processor of one session from options and context; may take a while, runs
            in a thread. What is heavy and read only is shared between sessions.
        hindrance: What keeps it from working here as these options say (packages, weights, a
            server that answers) and what would mend it, in one sentence for people; empty if
            nothing does. Quick, and never raises: asked where the best is wanted.
        stand_in: True for the offline three.
        detail: Which model these options mean, for the visitor's eyes.
    """

    title: str
    settings: type
    make: Callable[[Any, Context], FrameProcessor]
    hindrance: Callable[[Any], str] = unhindered
    stand_in: bool = False
    detail: Callable[[Any], str] = nothing


Table = dict[str, Provider]
"""Providers of one kind by name, the best first."""
