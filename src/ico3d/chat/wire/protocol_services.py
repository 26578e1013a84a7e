"""What messages say of the services that make a conversation; a part of `protocol.py`."""

from dataclasses import dataclass
from typing import Annotated, Literal

from ico3d.chat.wire.marks import Length, Name, Words


@dataclass(frozen=True)
class Service:
    """One of the three services that make the conversation.

    Attributes:
        name: For the visitor's eyes.
        stand_in: True for the small offline ones that the page says plainly are in use.
    """

    name: Name
    stand_in: bool


@dataclass(frozen=True)
class Services:
    """Who listens, thinks and speaks.

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
    """A service that could do one of the three jobs; the best ones come first.

    Attributes:
        kind: Which job.
        key: Name of the service in settings and wishes.
        name: For the visitor's eyes, as in `services`.
        hindrance: What keeps it from working and what would mend it; empty if it works.
    """

    kind: Literal["recognition", "language", "voice"]
    key: Name
    name: Name
    hindrance: Words


@dataclass(frozen=True)
class Dictation:
    """The visitor's browser is to recognise speech, besides sending it.

    Attributes:
        language: BCP 47 tag of what is spoken; empty for the browser's own language.
        fallback: Who listens where the browser cannot, for the visitor's eyes; null for nobody.
    """

    language: Annotated[str, Length(0, 35)]
    fallback: Name | None
