"""The services that visitors may choose from, and their choices."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ico3d.chat.services import TABLES, Chosen, ChosenService, chosen, with_voice
from ico3d.chat.services.own_voice import Own, speaking
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire import protocol

LONGEST_HINDRANCE = 400  # characters: all offers go into one message


def offers(
    settings: ChatSettings, voices: Mapping[str, str], own: Own | None = None
) -> list[protocol.Offer]:
    """All services and what hinders them, for the page; asking each of them may take 1 s.

    Args:
        settings: Names and options of the services.
        voices: The persona's voice for each provider of voices.
        own: The voice that was cloned for the avatar.

    Raises:
        SettingsError: If options are wrong.
    """
    found = []
    for kind, table in TABLES.items():
        for key in table:
            service = named(settings, voices, kind, key, own)
            hindrance = service.provider.hindrance(service.options)[:LONGEST_HINDRANCE]
            name = service.described().name
            found.append(protocol.Offer(kind, key, name, hindrance))  # type: ignore[arg-type]
    return found


def named(
    settings: ChatSettings,
    voices: Mapping[str, str],
    kind: str,
    key: str,
    own: Own | None = None,
) -> ChosenService:
    """A service of a table with the options that settings and persona give for it.

    Raises:
        SettingsError: If the options are wrong.
    """
    set_choice: Choice = getattr(settings, kind)
    choice = set_choice if set_choice.use == key else Choice(key)
    service = chosen(TABLES[kind], choice, kind)
    if kind != "voice":
        return service
    return speaking(choice, voices, own) or with_voice(service, choice, voices)


def wished(
    services: Chosen,
    settings: ChatSettings,
    voices: Mapping[str, str],
    wishes: Mapping[str, str],
    offered: Sequence[protocol.Offer],
    own: Own | None = None,
) -> Chosen:
    """The services with a visitor's wishes, as far as those are offered and work.

    Args:
        services: Services for visitors without wishes.
        settings: Options of all services.
        voices: The persona's voice for each provider of voices.
        wishes: Wished services by kind, as keys of offers.
        offered: Services that may be wished for.
        own: The voice that was cloned for the avatar.
    """
    working = {(offer.kind, offer.key) for offer in offered if not offer.hindrance}
    granted = {
        kind: named(settings, voices, kind, key, own)
        for kind, key in wishes.items()
        if (kind, key) in working
    }
    return replace(services, **granted)
