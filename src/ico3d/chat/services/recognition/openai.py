"""Speech recognition by an OpenAI-compatible server, through pipecat's own service."""

import socket
from dataclasses import dataclass
from urllib.parse import urlsplit

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.keys import check_key
from ico3d.chat.services.provider import Context, lacks_server
from ico3d.chat.services.recognition.segments import LONGEST_SPEECH, check_longest_speech

WHERE = "chat settings: recognition 'openai'"
KNOCK = 0.3  # s that a server may take to accept a connection


@dataclass(frozen=True)
class Settings:
    """Which server.

    Attributes:
        url: Its address, such as `http://localhost:8000/v1`; empty for OpenAI's own.
        model: Name of its model.
        key_variable: Environment variable that holds the key; empty for none, or for
            OPENAI_API_KEY where the server is OpenAI's. It is sent nowhere unencrypted but to
            this machine.
        language: Code of the language that is spoken, such as `de`; empty: the server tells.
        timeout: Seconds after which a transcript is given up, one retry included.
        longest_speech: Seconds of unbroken speech that are recognised at once, 5 to 300; what goes
            on longer is cut at a quiet place, and the pieces make one turn.
    """

    url: str = ""
    model: str = "whisper-1"
    key_variable: str = ""
    language: str = ""
    timeout: float = 8.0
    longest_speech: float = LONGEST_SPEECH

    def __post_init__(self):
        """Checks where the key would go, and ranges.

        Raises:
            SettingsError: If the key must not go there, or speech is cut too soon or too late.
        """
        check_key(self.url, self.key_variable, WHERE)
        check_longest_speech(self.longest_speech, WHERE)


def hindrance(settings: Settings) -> str:
    """No server, no key, or a server that is not there."""
    lacking = lacks_server(settings.url, settings.key_variable, "recognition")
    if lacking or not settings.url:
        return lacking
    try:
        address = urlsplit(settings.url)
        port = address.port or (443 if address.scheme == "https" else 80)
        socket.create_connection((address.hostname or "", port), KNOCK).close()
    except (OSError, ValueError):
        return f"no server answers at {settings.url}: start it, or set [recognition] url."
    return ""


def make(settings: Settings, context: Context) -> FrameProcessor:
    """A recogniser for one session.

    Raises:
        SettingsError: If the key is not here.
    """
    from ico3d.chat.services.recognition.openai_service import OpenAIRecognition

    return OpenAIRecognition(settings)
