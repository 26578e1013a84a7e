"""Chooses a provider from a table: the one in the settings, or the first that works."""

from dataclasses import dataclass
from typing import Any

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.chat.services.provider import Context, Provider, Table
from ico3d.chat.settings.conversation import BEST, Choice, filled
from ico3d.chat.wire import protocol
from ico3d.chat.wire.marks import LONGEST_NAME
from ico3d.errors import SettingsError


@dataclass(frozen=True)
class ChosenService:
    """A provider with its options.

    Attributes:
        provider: The provider.
        options: Instance of the provider's settings.
    """

    provider: Provider
    options: Any

    def make(self, context: Context) -> FrameProcessor:
        """Creates the processor of one session; may take a while."""
        return self.provider.make(self.options, context)

    def described(self) -> protocol.Service:
        """Name of the service for the page."""
        title, detail = self.provider.title, self.provider.detail(self.options)
        name = f"{title} ({detail})" if detail else title
        return protocol.Service(name[:LONGEST_NAME], self.provider.stand_in)


def chosen(table: Table, choice: Choice, kind: str) -> ChosenService:
    """A provider by its name, or the first of the table that works on this machine.

    Args:
        table: Providers of one kind, by name.
        choice: Name and options.
        kind: Name of the kind, for errors.

    Raises:
        SettingsError: If the provider is unknown, its options are wrong, or none works.
    """
    if choice.use == BEST:
        if choice.options:
            raise SettingsError(f"chat settings: {kind} has options but does not say 'use'.")
        return best(table, kind)
    provider = table.get(choice.use)
    if provider is None:
        names = " or ".join((*table, BEST))
        raise SettingsError(f"chat settings: {kind} '{choice.use[:80]}' is unknown, use {names}.")
    where = f"chat settings: {kind} '{choice.use}'"
    return ChosenService(provider, filled(provider.settings, choice.options, where))


def best(table: Table, kind: str) -> ChosenService:
    """The first provider of a table that works on this machine.

    Raises:
        SettingsError: If no provider works.
    """
    hindrance = ""
    for provider in table.values():
        options = provider.settings()
        hindrance = provider.hindrance(options)
        if not hindrance:
            return ChosenService(provider, options)
    raise SettingsError(f"no {kind} works here; the last one needs this: {hindrance}")
