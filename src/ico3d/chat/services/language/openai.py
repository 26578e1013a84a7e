"""Any language model behind an OpenAI-compatible server, through pipecat's own service."""

import os
from dataclasses import dataclass

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.bundle.manifest import Persona
from ico3d.chat.services.provider import Context


@dataclass(frozen=True)
class Settings:
    """Which server.

    Attributes:
        url: Its address, such as `http://localhost:11434/v1`; empty for the provider's own.
        model: Name of its model.
        key_variable: Environment variable that holds the key.
    """

    url: str = ""
    model: str = "gpt-4.1-mini"
    key_variable: str = "OPENAI_API_KEY"


def make(settings: Settings, context: Context) -> FrameProcessor:
    """A language model for one session that knows the persona's notes."""
    from pipecat.services.openai.llm import OpenAILLMService

    return OpenAILLMService(
        api_key=os.environ.get(settings.key_variable, "none"),
        base_url=settings.url or None,
        settings=OpenAILLMService.Settings(
            model=settings.model, system_instruction=instruction(context.persona)
        ),
    )


def instruction(persona: Persona) -> str:
    """What the model is told about who it is."""
    notes = "\n".join(persona.notes)
    return (
        f"You are {persona.name}, talking with a visitor. Your answers are spoken aloud: use one "
        "to three short sentences, no lists, no markup. Notes about you, as 'questions => answer':"
        f"\n{notes}"
    )
