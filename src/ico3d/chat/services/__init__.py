"""The three services of a conversation, by name.

pipecat's own services serve wherever one exists; those in these folders are the offline three,
which need no download, and what is too small to be elsewhere. A new one is a module with its
`Settings` and one entry in the table of its kind.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat import protocol
from ico3d.chat.marks import LONGEST_NAME
from ico3d.chat.services import language, recognition, voice
from ico3d.chat.services.provider import Context, Provider, Table
from ico3d.chat.services.recognition import browser
from ico3d.chat.settings import BEST, ChatSettings, Choice, filled
from ico3d.errors import SettingsError

TABLES: Mapping[str, Table] = {
    "recognition": recognition.PROVIDERS,
    "language": language.PROVIDERS,
    "voice": voice.PROVIDERS,
}
"""Providers by kind and name."""


@dataclass(frozen=True)
class Service:
    """A provider with its options.

    Attributes:
        provider: Who does the job.
        options: An instance of its settings.
    """

    provider: Provider
    options: Any

    def make(self, context: Context) -> FrameProcessor:
        """The processor of one session; may take a while."""
        return self.provider.make(self.options, context)

    def described(self) -> protocol.Service:
        """As the page is told."""
        title, detail = self.provider.title, self.provider.detail(self.options)
        name = f"{title} ({detail})" if detail else title
        return protocol.Service(name[:LONGEST_NAME], self.provider.stand_in)


@dataclass(frozen=True)
class Chosen:
    """The services that the settings name."""

    recognition: Service
    language: Service
    voice: Service

    def described(self) -> protocol.Services:
        """As the page is told."""
        services = (self.recognition, self.language, self.voice)
        return protocol.Services(*(service.described() for service in services))

    def dictation(self) -> protocol.Dictation | None:
        """What the page is told where its browser recognises speech."""
        options = self.recognition.options
        if not isinstance(options, browser.Settings):
            return None
        listener = fallback(options)
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


def with_voice(service: Service, choice: Choice, voices: Mapping[str, str]) -> Service:
    """A service that speaks with the persona's voice, unless the settings name another."""
    names = [n for n, provider in voice.PROVIDERS.items() if provider is service.provider]
    own = next((voices[name] for name in names if name in voices), None)
    if own is None or "voice" in choice.options or not hasattr(service.options, "voice"):
        return service
    return replace(service, options=replace(service.options, voice=own))


def chosen(table: Table, choice: Choice, kind: str) -> Service:
    """A service by its name, or the first of the table that works here.

    Args:
        table: Providers of this kind.
        choice: Which, and how.
        kind: What an error calls it.

    Raises:
        SettingsError: If it is unknown, its options are wrong, or none works.
    """
    if choice.use == BEST:
        if choice.options:
            raise SettingsError(f"chat settings: {kind} has options but does not say 'use'.")
        return best(table, kind)
    provider = table.get(choice.use)
    if provider is None:
        names = " or ".join((*table, BEST))
        raise SettingsError(f"chat settings: {kind} '{choice.use}' is unknown, use {names}.")
    where = f"chat settings: {kind} '{choice.use}'"
    return Service(provider, filled(provider.settings, choice.options, where))


def fallback(options: browser.Settings) -> Service | None:
    """The recogniser of the server for browsers that have none.

    Raises:
        SettingsError: If it is unknown, or none works.
    """
    if not options.fallback:
        return None
    table = {name: p for name, p in recognition.PROVIDERS.items() if p.make is not browser.make}
    return chosen(table, Choice(options.fallback), "recognition")


def best(table: Table, kind: str) -> Service:
    """The first of a table that works here.

    Raises:
        SettingsError: If none does.
    """
    hindrance = ""
    for provider in table.values():
        options = provider.settings()
        hindrance = provider.hindrance(options)
        if not hindrance:
            return Service(provider, options)
    raise SettingsError(f"no {kind} works here; the last one needs this: {hindrance}")
