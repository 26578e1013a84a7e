"""Which provider of a table does the job: the one that settings name, or the first that works."""

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


def chosen(table: Table, choice: Choice, kind: str) -> ChosenService:
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
    return ChosenService(provider, filled(provider.settings, choice.options, where))


def best(table: Table, kind: str) -> ChosenService:
    """The first of a table that works here.

    Raises:
        SettingsError: If none does.
    """
    hindrance = ""
    for provider in table.values():
        options = provider.settings()
        hindrance = provider.hindrance(options)
        if not hindrance:
            return ChosenService(provider, options)
    raise SettingsError(f"no {kind} works here; the last one needs this: {hindrance}")
