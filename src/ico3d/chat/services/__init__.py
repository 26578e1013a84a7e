"""The three services of a conversation, by name.

pipecat's own services serve wherever one exists; those in this folder are the offline three, which
need no download, and what is too small to be elsewhere. A new one is one entry in a table below.
"""

from collections.abc import Callable
from dataclasses import dataclass

from pipecat.processors.frame_processor import FrameProcessor

from ico3d.bundle.manifest import Persona
from ico3d.chat import protocol
from ico3d.chat.services import espeak, openai, persona, sphinx
from ico3d.chat.settings import ChatSettings
from ico3d.errors import SettingsError

Factory = Callable[[ChatSettings, Persona], FrameProcessor]


@dataclass(frozen=True)
class Entry:
    """One service.

    Attributes:
        title: For the visitor's eyes.
        stand_in: True for the offline three.
        make: Makes the processor for one session; may take a while, runs in a thread.
    """

    title: str
    stand_in: bool
    make: Factory


RECOGNITION = {"pocketsphinx": Entry("pocketsphinx", True, sphinx.make)}
LANGUAGE = {
    "persona-notes": Entry("persona notes", True, persona.make),
    "openai": Entry("OpenAI-compatible server", False, openai.make),
}
VOICE = {"espeak-ng": Entry("espeak-ng", True, espeak.make)}


@dataclass(frozen=True)
class Chosen:
    """The services that the settings name."""

    recognition: Entry
    language: Entry
    voice: Entry

    def described(self) -> protocol.Services:
        """As the page is told."""
        entries = (self.recognition, self.language, self.voice)
        return protocol.Services(*(protocol.Service(e.title, e.stand_in) for e in entries))


def choose(settings: ChatSettings) -> Chosen:
    """Finds the services that the settings name.

    Raises:
        SettingsError: If one is unknown.
    """
    return Chosen(
        _find(RECOGNITION, settings.recognition, "recognition"),
        _find(LANGUAGE, settings.language, "language"),
        _find(VOICE, settings.voice, "voice"),
    )


def _find(table: dict[str, Entry], name: str, kind: str) -> Entry:
    if name not in table:
        raise SettingsError(f"chat settings: {kind} '{name}' is unknown, use {' or '.join(table)}.")
    return table[name]
