"""What a conversation is made of: one settings file chooses the services and the timing."""

import dataclasses
import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from ico3d.errors import SettingsError

BEST = "best"
"""Name that chooses the best service that works here as it is."""
T = TypeVar("T")


@dataclass(frozen=True)
class Choice:
    """Which service does one of the jobs: a table of the settings file, or its name alone.

    Attributes:
        use: Name of the provider, or `best`.
        options: Its own settings by name; the rest of the table.
    """

    use: str = BEST
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Turns:
    """Who speaks when: the table `[turns]`.

    Attributes:
        pause: Seconds of silence after which the end of a turn is considered.
        end_silence: Seconds of silence that end a turn even if it sounded unfinished.
        speculate: Whether an answer is prepared as soon as the turn may be over; it is heard only
            if it was. Costs a request for each pause within a turn.
        interrupt_after: Seconds that a voice must last to interrupt the avatar.
        longest_backchannel: Seconds after which even "uh-huh" and humming interrupt it.
    """

    pause: float = 0.2
    end_silence: float = 0.6
    speculate: bool = True
    interrupt_after: float = 0.4
    longest_backchannel: float = 1.0

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If the timing makes no sense.
        """
        if not 0.1 <= self.pause <= self.end_silence <= 10:
            raise SettingsError(
                "chat settings: 0.1 <= pause <= end_silence <= 10 seconds must hold."
            )
        if not 0.1 <= self.interrupt_after <= self.longest_backchannel <= 10:
            raise SettingsError(
                "chat settings: 0.1 <= interrupt_after <= longest_backchannel <= 10 seconds "
                "must hold."
            )


@dataclass(frozen=True)
class ChatSettings:
    """Services and timing of a conversation; the file may be TOML or JSON.

    Attributes:
        recognition: Speech to text.
        language: Question to answer.
        voice: Text to speech.
        turns: Who speaks when.
        max_sessions: How many visitors at once, those included whose connection dropped.
        idle_minutes: A session ends when for so long nobody spoke or typed and nothing was played;
            0 for never.
        gestures: Whether a body gestures while it speaks; otherwise it is held at rest.
    """

    recognition: Choice = Choice()
    language: Choice = Choice()
    voice: Choice = Choice()
    turns: Turns = Turns()
    max_sessions: int = 4
    idle_minutes: float = 10.0
    gestures: bool = True

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If the limits of sessions make no sense.
        """
        if self.max_sessions < 1:
            raise SettingsError("chat settings: max_sessions must be at least 1.")
        if not 0 <= self.idle_minutes < math.inf:
            raise SettingsError("chat settings: idle_minutes must be 0 (never) or more.")


def read_settings(path: Path | None) -> ChatSettings:
    """Reads a settings file; the defaults where there is none.

    Raises:
        SettingsError: If the file is missing, malformed, or has unknown or wrong entries.
    """
    return ChatSettings() if path is None else filled(ChatSettings, _parse(path), str(path))


def filled(kind: type[T], values: Mapping[str, Any], where: str) -> T:
    """A dataclass of settings with some values set.

    Args:
        kind: Its fields are numbers, words, truth values, lists of words, or such dataclasses.
        values: By name of the field, as TOML and JSON give them.
        where: What an error names as the place.

    Raises:
        SettingsError: If a name is unknown or a value is of the wrong type.
    """
    fields = {f.name: f.type for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    for name in values:
        if name not in fields:
            raise SettingsError(f"{where}: there is no setting '{name}', use {_any_of(fields)}.")
    return kind(**{name: _value(fields[name], v, where, name) for name, v in values.items()})


def _value(kind: Any, value: Any, where: str, name: str) -> Any:
    if kind is Choice:
        return _choice(value, where, name)
    if dataclasses.is_dataclass(kind) and isinstance(value, dict):
        return filled(kind, value, f"{where} [{name}]")  # type: ignore[arg-type]
    if kind == tuple[str, ...] and isinstance(value, list):
        if all(isinstance(entry, str) for entry in value):
            return tuple(value)
    elif kind is float and type(value) is int:
        return float(value)
    elif type(value) is kind:
        return value
    raise SettingsError(f"{where}: '{name}' must be {_described(kind)}.")


def _choice(value: Any, where: str, name: str) -> Choice:
    if isinstance(value, str):
        return Choice(value)
    if not isinstance(value, dict) or not isinstance(value.get("use", BEST), str):
        raise SettingsError(f"{where}: '{name}' must be a provider's name or a table with 'use'.")
    options = {key: entry for key, entry in value.items() if key != "use"}
    return Choice(value.get("use", BEST), options)


def _described(kind: Any) -> str:
    if kind == tuple[str, ...]:
        return "a list of texts"
    names = {str: "a text", int: "a whole number", float: "a number", bool: "true or false"}
    return names.get(kind, "a table")


def _any_of(names) -> str:
    return " or ".join(names)


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
