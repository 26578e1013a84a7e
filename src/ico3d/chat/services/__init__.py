"""The three services of a conversation, by name.

pipecat's own services serve wherever one exists; those in these folders are the offline three,
which need no download, and what is too small to be elsewhere. A new one is a module with its
`Settings` and one entry in the table of its kind.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ico3d.chat.services import language, recognition, voice
from ico3d.chat.services.choosing import ChosenService, chosen
from ico3d.chat.services.provider import Table
from ico3d.chat.services.recognition import browser
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire import protocol

TABLES: Mapping[str, Table] = {
    "recognition": recognition.PROVIDERS,
    "language": language.PROVIDERS,
    "voice": voice.PROVIDERS,
}
"""Providers by kind and name."""


@dataclass(frozen=True)
class Chosen:
    """The services that the settings name."""

    recognition: ChosenService
    language: ChosenService
    voice: ChosenService

    def described(self) -> protocol.Services:
        """As the page is told."""
        services = (self.recognition, self.language, self.voice)
        return protocol.Services(*(service.described() for service in services))

    def dictation(self) -> protocol.Dictation | None:
        """What the page is told where its browser recognises speech."""
        options = self.recognition.options
        if not isinstance(options, browser.Settings):
            return None
        listener = browser.fallback(recognition.ON_SERVER, options)
        return protocol.Dictation(options.language, listener and listener.provider.title)


def choose(settings: ChatSettings, voices: Mapping[str, str] | None = None) -> Chosen:
    """Finds the services that the settings name.

    Args:
        settings: Which services.
        voices: The persona's voice for each provider of voices; settings that name one win.

    Raises:
        SettingsError: If one is unknown, or its options are wrong.
    """
    return Chosen(
        chosen(recognition.PROVIDERS, settings.recognition, "recognition"),
        chosen(language.PROVIDERS, settings.language, "language"),
        with_voice(chosen(voice.PROVIDERS, settings.voice, "voice"), settings.voice, voices or {}),
    )


def with_voice(service: ChosenService, choice: Choice, voices: Mapping[str, str]) -> ChosenService:
    """A service that speaks with the persona's voice, unless the settings name another."""
    names = [n for n, provider in voice.PROVIDERS.items() if provider is service.provider]
    own = next((voices[name] for name in names if name in voices), None)
    if own is None or "voice" in choice.options or not hasattr(service.options, "voice"):
        return service
    return replace(service, options=replace(service.options, voice=own))
