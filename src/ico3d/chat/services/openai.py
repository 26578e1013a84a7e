"""Any language model behind an OpenAI-compatible server, through pipecat's own service."""

import os

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.bundle.manifest import Persona
from ico3d.chat.settings import ChatSettings


def make(settings: ChatSettings, persona: Persona) -> FrameProcessor:
    """A language model for one session that knows the persona's notes."""
    from pipecat.services.openai.llm import OpenAILLMService

    return OpenAILLMService(
        api_key=os.environ.get(settings.openai_key_variable, "none"),
        base_url=settings.openai_url or None,
        settings=OpenAILLMService.Settings(
            model=settings.openai_model, system_instruction=instruction(persona)
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
