"""What a conversation is made of: one settings file chooses the services and the timing."""

import dataclasses
import json
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ico3d.errors import SettingsError


@dataclass(frozen=True)
class ChatSettings:
    """Services and timing of a conversation; the file may be TOML or JSON.

    Attributes:
        recognition: Speech to text: `pocketsphinx`.
        language: Question to answer: `persona-notes` or `openai` (any server with that interface).
        voice: Text to speech: `espeak-ng`.
        espeak_voice: espeak-ng's language and variant.
        espeak_rate: Words per minute.
        openai_url: Address of the server for `openai`; empty for the provider's own.
        openai_model: Name of its model.
        openai_key_variable: Environment variable that holds the key.
        pause: Seconds of silence after which the end of a turn is considered.
        end_silence: Seconds of silence that end a turn even if it sounded unfinished.
        max_sessions: How many visitors at once, those included whose connection dropped.
        gestures: Whether a body gestures while it speaks; otherwise it is held at rest.
    """

    recognition: str = "pocketsphinx"
    language: str = "persona-notes"
    voice: str = "espeak-ng"
    espeak_voice: str = "en-us+f3"
    espeak_rate: int = 165
    openai_url: str = ""
    openai_model: str = "gpt-4.1-mini"
    openai_key_variable: str = "OPENAI_API_KEY"
    pause: float = 0.2
    end_silence: float = 0.6
    max_sessions: int = 4
    gestures: bool = True

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If the timing or the number of sessions makes no sense.
        """
        if not 0.1 <= self.pause <= self.end_silence <= 10:
            raise SettingsError(
                "chat settings: 0.1 <= pause <= end_silence <= 10 seconds must hold."
            )
        if self.max_sessions < 1:
            raise SettingsError("chat settings: max_sessions must be at least 1.")


def read_settings(path: Path | None) -> ChatSettings:
    """Reads a settings file; the defaults where there is none.

    Raises:
        SettingsError: If the file is missing, malformed, or has unknown or wrong entries.
    """
    if path is None:
        return ChatSettings()
    values = _parse(path)
    fields = {field.name: field.type for field in dataclasses.fields(ChatSettings)}
    for name, value in values.items():
        if name not in fields:
            raise SettingsError(f"{path}: there is no setting '{name}'.")
        accepted = (int, float) if fields[name] is float else (fields[name],)
        if type(value) not in accepted:
            raise SettingsError(f"{path}: '{name}' must be of type {fields[name].__name__}.")  # type: ignore[union-attr]
    return ChatSettings(**values)


def _parse(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
        values = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror}).") from error
    except ValueError as error:
        raise SettingsError(f"{path}: {error}.") from error
    if not isinstance(values, dict):
        raise SettingsError(f"{path}: must hold names and values.")
    return values
