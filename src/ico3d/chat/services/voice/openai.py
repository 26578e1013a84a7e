"""Any voice behind an OpenAI-compatible server."""

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.provider import Context, lacks_server
from ico3d.chat.services.voice.openai_settings import Settings


def hindrance(settings: Settings) -> str:
    """Whether a server is chosen."""
    return lacks_server(settings.url, settings.key_variable, "voice")


def make(settings: Settings, context: Context) -> FrameProcessor:
    """A voice for one session.

    Raises:
        SettingsError: If the key is not here.
    """
    from ico3d.chat.services.voice.openai_service import ServerVoice

    return ServerVoice(settings)
