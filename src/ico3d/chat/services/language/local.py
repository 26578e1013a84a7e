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
"""Where such servers are as a rule: Ollama; vLLM and `transformers serve`; llama.cpp."""
QUICK = 0.25  # s until one answers that is to be the best by itself
PATIENT = 2.0  # s until one answers that was chosen


@dataclass(frozen=True)
class Settings:
    """Which of its models.

    Attributes:
        model: Name of the model; empty for the first that the server offers.
        functions: Whether the model may call functions (gestures, moods, tools).
        temperature: Of the choice of words, 0 to 2; left to the server where not given.
        max_tokens: Longest answer, thoughts included; left to the server where not given.
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
    """Address and model of the first server that answers within some seconds."""
    found = first_server([f"http://127.0.0.1:{port}/v1" for port in PORTS], seconds)
    return found and (found[0], settings.model or found[1])


def hindrance(settings: Settings) -> str:
    """Says so where no language server answers on this machine; empty where one does."""
    if find(settings, QUICK) is not None:
        return ""
    return f"none answers on the ports {', '.join(map(str, PORTS))}: start Ollama, for example."


def detail(settings: Settings) -> str:
    """For the visitor's eyes: which model."""
    found = find(settings, PATIENT)
    return found[1] if found else settings.model


def make(settings: Settings, context: Context) -> FrameProcessor:
    """A language model for one session.

    Raises:
        SettingsError: If none answers any more.
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
