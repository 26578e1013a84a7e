"""Any language model behind an OpenAI-compatible server, through pipecat's own service."""

import os
from dataclasses import dataclass

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.language.instruction import instruction
from ico3d.chat.services.language.servers import language_models
from ico3d.chat.services.provider import Context
from ico3d.errors import SettingsError

OWN_KEY = "OPENAI_API_KEY"
OWN_MODEL = "gpt-4.1-mini"
SLOWEST = 5.0  # s for the list of a server's models


@dataclass(frozen=True)
class Settings:
    """Which server: vLLM, Ollama, llama.cpp, `transformers serve`, or a provider's.

    Attributes:
        url: Its address, such as `http://localhost:11434/v1`; empty for OpenAI's own.
        model: Name of its model; empty for the first that the server offers.
        key_variable: Environment variable that holds the key; empty for none, or for
            OPENAI_API_KEY where there is no `url`.
        functions: Whether the model may call functions (gestures, moods, tools).
    """

    url: str = ""
    model: str = ""
    key_variable: str = ""
    functions: bool = True


def make(settings: Settings, context: Context) -> FrameProcessor:
    """A language model for one session that knows who it is.

    Raises:
        SettingsError: If no key is there, or the server does not say which models it has.
    """
    from ico3d.chat.services.language.compatible import CompatibleModel

    return CompatibleModel(
        settings.url,
        key(settings),
        model(settings),
        instruction(context.persona),
        settings.functions,
    )


def detail(settings: Settings) -> str:
    """For the visitor's eyes: which model, as far as the settings say."""
    return settings.model or settings.url or OWN_MODEL


def key(settings: Settings) -> str:
    """The key to send; one for OpenAI goes nowhere else by itself.

    Raises:
        SettingsError: If the environment lacks it.
    """
    variable = settings.key_variable or ("" if settings.url else OWN_KEY)
    if not variable:
        return "none"
    value = os.environ.get(variable, "")
    if not value:
        raise SettingsError(
            f"chat settings: language 'openai' needs its key in the environment as {variable}."
        )
    return value


def model(settings: Settings) -> str:
    """The model to ask for.

    Raises:
        SettingsError: If the settings name none and the server offers none.
    """
    if settings.model or not settings.url:
        return settings.model or OWN_MODEL
    offered = language_models(settings.url, key(settings), SLOWEST)
    if not offered:
        raise SettingsError(
            f"chat settings: the language model's server {settings.url} offers no model: start "
            "it, or name one as 'model'."
        )
    return offered[0]
