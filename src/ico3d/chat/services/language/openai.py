"""Language models on OpenAI-compatible servers, through pipecat's own service."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.language.instruction import instruction
from ico3d.chat.services.language.sampling import check_sampling
from ico3d.chat.services.language.servers import language_models
from ico3d.chat.services.provider import Context, lacks_server
from ico3d.chat.settings.keys import NONE, check_key, is_openai, key_for
from ico3d.errors import SettingsError

WHERE = "chat settings: language 'openai'"
OWN_MODEL = "gpt-4.1-mini"
SLOWEST = 5.0  # s for the list of a server's models


@dataclass(frozen=True)
class Settings:
    """Options of `openai`: vLLM, Ollama, llama.cpp, `transformers serve`, or a provider's server.

    Attributes:
        url: Address of the server, such as `http://localhost:11434/v1`; empty for OpenAI's own.
        model: Name of the model; empty for the first that the server offers.
        key_variable: Environment variable that holds the server's key; empty for none, or for
            OPENAI_API_KEY where the server is OpenAI's. A key is never sent unencrypted to another
            machine.
        functions: Whether the model may call functions (gestures, moods, tools).
        temperature: Temperature of sampling, 0 to 2; the server's own if not given.
        max_tokens: Highest number of tokens of an answer, thoughts included; the server's own if
            not given.
        extra: Further fields of each request, such as `{ top_k = 20 }` or
            `{ chat_template_kwargs = { enable_thinking = false } }`.
    """

    url: str = ""
    model: str = ""
    key_variable: str = ""
    functions: bool = True
    temperature: float | None = None
    max_tokens: int | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        """Checks where the key would go, and what requests say.

        Raises:
            SettingsError: If the key must not go there, or a request would make no sense.
        """
        check_key(self.url, self.key_variable, WHERE)
        check_sampling(self.temperature, self.max_tokens, self.extra, WHERE)


def make(settings: Settings, context: Context) -> FrameProcessor:
    """Creates the language model of one session.

    Raises:
        SettingsError: If the key is missing, or the server does not list its models.
    """
    from pipecat.utils.http import connection_limits

    from ico3d.chat.services.client import client_options
    from ico3d.chat.services.language.compatible import CompatibleModel

    kept = connection_limits(
        max_keepalive_connections=100, max_connections=1000, keepalive_expiry=None
    )
    return CompatibleModel(
        client_options(settings.url, settings.key_variable, WHERE, limits=kept),
        model(settings),
        instruction(context.persona),
        settings.functions,
        sampling(settings),
    )


def sampling(settings: Settings) -> dict[str, Any]:
    """Settings of pipecat for a request; OpenAI's own models use another name for one of them."""
    longest = "max_completion_tokens" if is_openai(settings.url) else "max_tokens"
    given = {"temperature": settings.temperature, longest: settings.max_tokens}
    found: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return {**found, "extra": {"extra_body": dict(settings.extra)}} if settings.extra else found


def hindrance(settings: Settings) -> str:
    """A sentence if the settings name no server, else empty."""
    return lacks_server(settings.url, settings.key_variable, "language")


def detail(settings: Settings) -> str:
    """The model, as shown to visitors, if the settings name one; they are told no address."""
    return settings.model or ("" if settings.url else OWN_MODEL)


def model(settings: Settings) -> str:
    """The name of the model to request.

    Raises:
        SettingsError: If the settings name no model and the server offers none.
    """
    if settings.model or not settings.url:
        return settings.model or OWN_MODEL
    key = key_for(settings.url, settings.key_variable, WHERE) or NONE
    offered = language_models(settings.url, key, SLOWEST)
    if not offered:
        raise SettingsError(
            f"chat settings: the language model's server {settings.url} offers no model: start "
            "it, or name one as 'model'."
        )
    return offered[0]
