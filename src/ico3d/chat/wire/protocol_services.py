"""Parts of messages about the services of a conversation; part of `protocol.py`."""

from dataclasses import dataclass
from typing import Annotated, Literal

from ico3d.chat.wire.marks import Length, Name, Words


@dataclass(frozen=True)
class Service:
    """One of the three services that make the conversation.

    Attributes:
        name: Name, as shown to visitors.
        stand_in: True for one of the simple offline services, about which the page tells visitors.
    """

    name: Name
    stand_in: bool


@dataclass(frozen=True)
class Services:
    """The services of the conversation.

    Attributes:
        recognition: Speech to text.
        language: Question to answer.
        voice: Text to speech.
    """

    recognition: Service
    language: Service
    voice: Service


@dataclass(frozen=True)
class Offer:
    """A service that visitors may choose; preferred ones come first.

    Attributes:
        kind: Kind of the service.
        key: Name of the service in settings and wishes.
        name: Name, as shown to visitors.
        hindrance: What prevents the service from working and what would help; empty if it works.
    """

    kind: Literal["recognition", "language", "voice"]
    key: Name
    name: Name
    hindrance: Words


@dataclass(frozen=True)
class Dictation:
    """Asks the page to let the browser recognise speech, besides sending the sound.

    Attributes:
        language: BCP 47 tag of the spoken language; empty for the browser's language.
        fallback: Recogniser for browsers without recognition, as shown to visitors; null for none.
    """

    language: Annotated[str, Length(0, 35)]
    fallback: Name | None
