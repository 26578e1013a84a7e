"""What a provider of recognition, language or voice is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.bundle.animation import Animation
from ico3d.bundle.manifest import HeadInfo
from ico3d.bundle.persona import Persona


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


def always(settings: Any) -> bool:
    """For providers that need nothing beyond their package."""
    del settings
    return True


def nothing(settings: Any) -> str:
    """For providers whose title says all."""
    del settings
    return ""


@dataclass(frozen=True)
class Provider:
    """One way to do a job; an entry in the table of its kind.

    Attributes:
        title: For the visitor's eyes.
        settings: Dataclass of its options.
        make: Makes the processor of one session from options and context; may take a while, runs
            in a thread. What is heavy and read only is shared between sessions.
        works: Whether it would work here as these options say: packages installed, weights
            there, server answering. Quick; asked where the best is wanted.
        stand_in: True for the offline three.
        detail: Which model these options mean, for the visitor's eyes.
    """

    title: str
    settings: type
    make: Callable[[Any, Context], FrameProcessor]
    works: Callable[[Any], bool] = always
    stand_in: bool = False
    detail: Callable[[Any], str] = nothing


Table = dict[str, Provider]
"""Providers of one kind by name, the best first."""
