"""Voices on OpenAI-compatible servers."""

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.provider import Context, lacks_server
from ico3d.chat.services.voice.openai_settings import Settings


def hindrance(settings: Settings) -> str:
    """A sentence if the settings name no server, else empty."""
    return lacks_server(settings.url, settings.key_variable, "voice")


def make(settings: Settings, context: Context) -> FrameProcessor:
    """Creates the voice of one session.

    Raises:
        SettingsError: If the key is missing.
    """
    from ico3d.chat.services.voice.openai_service import ServerVoice

    return ServerVoice(settings)
