"""Speech recognition by an OpenAI-compatible server, through pipecat's own service."""

import socket
from urllib.parse import urlsplit

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.provider import IN_FILE, Context, lacks_server
from ico3d.chat.services.recognition.openai_settings import Settings

KNOCK = 0.3  # s that a server may take to accept a connection


def hindrance(settings: Settings) -> str:
    """A sentence if no server is named, its key is missing, or it does not answer; else empty."""
    lacking = lacks_server(settings.url, settings.key_variable, "recognition")
    if lacking or not settings.url:
        return lacking
    try:
        address = urlsplit(settings.url)
        port = address.port or (443 if address.scheme == "https" else 80)
        socket.create_connection((address.hostname or "", port), KNOCK).close()
    except (OSError, ValueError):
        return f"no server answers at {settings.url}: start it, or set [recognition] url{IN_FILE}."
    return ""


def make(settings: Settings, context: Context) -> FrameProcessor:
    """Creates the recogniser of one session.

    Raises:
        SettingsError: If the key is missing.
    """
    from ico3d.chat.services.recognition.openai_service import OpenAIRecognition

    return OpenAIRecognition(settings)
