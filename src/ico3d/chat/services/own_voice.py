"""The voice that was cloned for an avatar: whether it can be heard, and if not, why."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ico3d.bundle.format import Bundle
from ico3d.bundle.persona import Persona
from ico3d.chat.services import voice
from ico3d.chat.services.choosing import ChosenService
from ico3d.chat.services.voice.openvoice import OwnVoice, Settings
from ico3d.chat.settings.conversation import BEST, Choice, filled

OPENVOICE = "openvoice"
SPEAKERS = {"en": "EN-US", "es": "ES", "fr": "FR", "zh": "ZH", "ja": "JP", "ko": "KR"}
"""Who speaks before it is made the avatar's voice, by language."""


@dataclass(frozen=True)
class Own:
    """The voice of an avatar.

    Attributes:
        tone: Its tone colour: 256 float32 values.
        languages: Codes of the languages in which the avatar answers, its own first.
    """

    tone: bytes
    languages: tuple[str, ...]

    @property
    def speaker(self) -> str:
        """Who speaks the avatar's first language; empty where OpenVoice does not speak it."""
        if not self.languages:
            return SPEAKERS["en"]
        return SPEAKERS.get(self.languages[0].partition("-")[0], "")


def own_of(bundle: Bundle, persona: Persona) -> Own | None:
    """The voice that was cloned for the avatar of a bundle; None where none was."""
    return None if bundle.voice is None else Own(bundle.voice.tobytes(), persona.languages)


def speaking(choice: Choice, voices: Mapping[str, str], own: Own | None) -> ChosenService | None:
    """OpenVoice with the avatar's own voice; None where that cannot be heard.

    Args:
        choice: What the settings say of the voice.
        voices: The persona's voice for each provider of voices.
        own: The avatar's own voice.

    Raises:
        SettingsError: If the options are wrong.
    """
    if own is None or _unheard(choice, voices, own):
        return None
    return ChosenService(voice.PROVIDERS[OPENVOICE], _options(choice, voices, own))


def unheard(choice: Choice, voices: Mapping[str, str], own: Own | None) -> str:
    """Why the voice that was cloned for an avatar is not heard; empty where it is, or none was.

    Args:
        choice: What the settings say of the voice.
        voices: The persona's voice for each provider of voices.
        own: The avatar's own voice.
    """
    return "" if own is None else _unheard(choice, voices, own)


def _unheard(choice: Choice, voices: Mapping[str, str], own: Own) -> str:
    if choice.use not in (BEST, OPENVOICE) or choice.options.get("reference"):
        return "the settings choose another voice."
    if choice.use == BEST and choice.options:
        return "the settings have options and do not say whose."
    if not _speaker(choice, voices, own):
        return f"OpenVoice does not speak '{own.languages[0]}', the persona's language."
    return voice.PROVIDERS[OPENVOICE].hindrance(_options(choice, voices, own))


def _speaker(choice: Choice, voices: Mapping[str, str], own: Own) -> str:
    """Who speaks: as the settings, the persona or its language have it; empty for nobody."""
    return str(choice.options.get("voice") or voices.get(OPENVOICE) or own.speaker)


def _options(choice: Choice, voices: Mapping[str, str], own: Own) -> OwnVoice:
    given = filled(Settings, choice.options, f"chat settings: voice '{OPENVOICE}'")
    spoken: dict[str, Any] = {"voice": _speaker(choice, voices, own), "tone": own.tone}
    return OwnVoice(**(vars(given) | spoken))
