"""The three services of a conversation, recognition, language and voice, by name.

pipecat's own services are used wherever one exists. The modules in these folders are the three
offline services, which need no download, and thin adapters. A new service is a module with a class
`Settings`, and an entry in the table of its kind.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ico3d.chat.services import language, recognition, voice
from ico3d.chat.services.choosing import ChosenService, chosen
from ico3d.chat.services.own_voice import Own, speaking
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
    """The services that the settings choose."""

    recognition: ChosenService
    language: ChosenService
    voice: ChosenService

    def described(self) -> protocol.Services:
        """Names of the services for the page."""
        services = (self.recognition, self.language, self.voice)
        return protocol.Services(*(service.described() for service in services))

    def dictation(self) -> protocol.Dictation | None:
        """What the page needs to know if its browser recognises speech, else None."""
        options = self.recognition.options
        if not isinstance(options, browser.Settings):
            return None
        listener = browser.fallback(recognition.ON_SERVER, options)
        title = listener.provider.title if listener else None
        return protocol.Dictation(options.language, title)


def choose(
    settings: ChatSettings, voices: Mapping[str, str] | None = None, own: Own | None = None
) -> Chosen:
    """Finds the services that the settings name.

    Args:
        settings: Names and options of the services.
        voices: The persona's voice for each provider of voices; a voice in the settings has
            priority.
        own: The voice that was cloned for the avatar, which is heard where it can be.

    Raises:
        SettingsError: If a service is unknown, or its options are wrong.
    """
    return Chosen(
        chosen(recognition.PROVIDERS, settings.recognition, "recognition"),
        chosen(language.PROVIDERS, settings.language, "language"),
        speaking(settings.voice, voices or {}, own)
        or with_voice(
            chosen(voice.PROVIDERS, settings.voice, "voice"), settings.voice, voices or {}
        ),
    )


def with_voice(service: ChosenService, choice: Choice, voices: Mapping[str, str]) -> ChosenService:
    """A service with the persona's voice, unless the settings name another voice."""
    names = [n for n, provider in voice.PROVIDERS.items() if provider is service.provider]
    own = next((voices[name] for name in names if name in voices), None)
    if own is None or "voice" in choice.options or not hasattr(service.options, "voice"):
        return service
    return replace(service, options=replace(service.options, voice=own))
