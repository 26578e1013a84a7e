"""Options of the voice on an OpenAI-compatible server."""

from dataclasses import dataclass

from ico3d.chat.services.voice.base import STARVED
from ico3d.chat.settings.keys import check_key
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.errors import SettingsError

WHERE = "chat settings: voice 'openai'"


@dataclass(frozen=True)
class Settings:
    """Options of the voice `openai`.

    Attributes:
        url: Address of the server, such as `http://localhost:8880/v1`; empty for OpenAI's own.
        model: Name of the model.
        voice: Name of the voice.
        key_variable: Environment variable that holds the server's key; empty for none, or for
            OPENAI_API_KEY where the server is OpenAI's. A key is never sent unencrypted to another
            machine.
        rate: Samples per second of the server's sound, unless it sends WAV files, which state their
            rate.
        timeout: Seconds to wait for the first sound, and between two pieces of it.
    """

    url: str = ""
    model: str = "gpt-4o-mini-tts"
    voice: str = "alloy"
    key_variable: str = ""
    rate: int = SPEECH_RATE
    timeout: float = 10.0

    def __post_init__(self):
        """Checks ranges, and where the key would go.

        Raises:
            SettingsError: If rate or time-out make no sense, or the key must not go there.
        """
        check_key(self.url, self.key_variable, WHERE)
        if not (8000 <= self.rate <= 48000 and 0 < self.timeout < STARVED):
            raise SettingsError(
                "chat settings: voice 'openai': rate must be 8000 to 48000 samples per second "
                f"and timeout less than {STARVED:.0f} seconds."
            )
