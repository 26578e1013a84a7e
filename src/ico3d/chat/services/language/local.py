"""An OpenAI-compatible server on this machine: Ollama, vLLM, llama.cpp, `transformers serve`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.language import openai
from ico3d.chat.services.language.sampling import check_sampling
from ico3d.chat.services.language.servers import first_server
from ico3d.chat.services.provider import Context
from ico3d.errors import SettingsError

PORTS = (11434, 8000, 8080)
"""Usual ports of such servers: Ollama; vLLM and `transformers serve`; llama.cpp."""
QUICK = 0.25  # s until one answers that is to be the best by itself
PATIENT = 2.0  # s until one answers that was chosen


@dataclass(frozen=True)
class Settings:
    """Options of the language model `local`.

    Attributes:
        model: Name of the model; empty for the first that the server offers.
        functions: Whether the model may call functions (gestures, moods, tools).
        temperature: Temperature of sampling, 0 to 2; the server's own if not given.
        max_tokens: Highest number of tokens of an answer, thoughts included; the server's own if
            not given.
        extra: Further fields of each request, such as `{ top_k = 20 }` or
            `{ chat_template_kwargs = { enable_thinking = false } }`.
    """

    model: str = ""
    functions: bool = True
    temperature: float | None = None
    max_tokens: int | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        """Checks what requests say.

        Raises:
            SettingsError: If they would make no sense.
        """
        where = "chat settings: language 'local'"
        check_sampling(self.temperature, self.max_tokens, self.extra, where)


def find(settings: Settings, seconds: float) -> tuple[str, str] | None:
    """Address and model of the first server that answers within `seconds`, or None."""
    found = first_server([f"http://127.0.0.1:{port}/v1" for port in PORTS], seconds)
    return found and (found[0], settings.model or found[1])


def hindrance(settings: Settings) -> str:
    """A sentence if no language server answers on this machine, else empty."""
    if find(settings, QUICK) is not None:
        return ""
    return f"none answers on the ports {', '.join(map(str, PORTS))}: start Ollama, for example."


def detail(settings: Settings) -> str:
    """The model, as shown to visitors."""
    found = find(settings, PATIENT)
    return found[1] if found else settings.model


def make(settings: Settings, context: Context) -> FrameProcessor:
    """Creates the language model of one session.

    Raises:
        SettingsError: If no server answers any more.
    """
    found = find(settings, PATIENT)
    if found is None:
        ports = ", ".join(map(str, PORTS))
        raise SettingsError(
            f"chat settings: no OpenAI-compatible server with a language model answers on this "
            f"machine's ports {ports}: start one, or choose another language."
        )
    url, model = found
    asked = openai.Settings(
        url,
        model,
        functions=settings.functions,
        temperature=settings.temperature,
        max_tokens=settings.max_tokens,
        extra=settings.extra,
    )
    return openai.make(asked, context)
