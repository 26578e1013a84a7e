"""What a conversation is made of: one settings file chooses the services and the timing."""

import dataclasses
import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin

from ico3d.chat.settings.keys import check_key
from ico3d.chat.settings.tools import Tool, check_tools
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
class Patience:
    """How long services may take before the avatar apologises: the table `[patience]`.

    Attributes:
        language: Seconds until the first words of an answer, and between two pieces of it.
        reasoning: Seconds that a model may think before its first words, as long as it shows that
            it does.
        voice: Seconds until the first sound of a sentence, and between two pieces of it.
        apologies: Language that the avatar apologises in, such as `de`; empty for the persona's
            first. English where it is none of those known.
    """

    language: float = 12.0
    reasoning: float = 60.0
    voice: float = 8.0
    apologies: str = ""

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If there is no patience at all.
        """
        if min(self.language, self.reasoning, self.voice) < 0.1:
            raise SettingsError("chat settings: [patience] needs at least 0.1 seconds for each.")


@dataclass(frozen=True)
class Expression:
    """Where sound becomes a moving face: the table `[expression]`.

    Attributes:
        use: `own` for the avatar's speech model in this process; `remote` for the same one on
            another machine, and in this process whenever that fails.
        url: Of `ico3d serve-module expression`, such as `http://127.0.0.1:8766` where a tunnel
            ends.
        key_variable: Environment variable that holds its key, if it wants one. It is sent nowhere
            unencrypted but to this machine.
        timeout: Seconds that a piece of sound may take before the face goes on here.
    """

    use: str = "own"
    url: str = ""
    key_variable: str = ""
    timeout: float = 0.5

    def __post_init__(self):
        """Checks that they fit together.

        Raises:
            SettingsError: If they do not.
        """
        if self.use not in ("own", "remote"):
            raise SettingsError(f"chat settings: expression '{self.use}': use own or remote.")
        if self.use == "remote" and not self.url.startswith(("http://", "https://")):
            raise SettingsError("chat settings: [expression] needs the url of the remote module.")
        if self.use == "remote":
            check_key(self.url, self.key_variable, "chat settings: [expression]")


@dataclass(frozen=True)
class Memory:
    """What a language model still knows of the conversation: the table `[memory]`.

    Attributes:
        tokens: About how long the conversation may get before all but its latest words is
            summarised, the system instruction not counted.
    """

    tokens: int = 4000

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If nothing could be remembered.
        """
        if self.tokens < 200:
            raise SettingsError("chat settings: [memory] needs at least 200 tokens.")


@dataclass(frozen=True)
class ChatSettings:
    """Services and timing of a conversation; the file may be TOML or JSON.

    Attributes:
        recognition: Speech to text.
        language: Question to answer.
        voice: Text to speech.
        turns: Who speaks when.
        patience: How long services may take.
        expression: Where sound becomes a moving face.
        max_sessions: How many visitors at once, those included whose connection dropped.
        idle_minutes: A session ends when for so long nobody spoke or typed and nothing was played;
            0 for never.
        gestures: Whether a body gestures while it speaks; otherwise it is held at rest.
        memory: What is still known of the conversation.
        tools: Functions over HTTP that the language model may call.
        allow: Hosts that tools may call, such as `api.example.org` or `127.0.0.1:9000`; private
            addresses must be listed themselves.
    """

    recognition: Choice = Choice()
    language: Choice = Choice()
    voice: Choice = Choice()
    turns: Turns = Turns()
    patience: Patience = Patience()
    expression: Expression = Expression()
    max_sessions: int = 4
    idle_minutes: float = 10.0
    gestures: bool = True
    memory: Memory = Memory()
    tools: tuple[Tool, ...] = ()
    allow: tuple[str, ...] = ()

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If the limits of sessions make no sense, or a tool does not.
        """
        if self.max_sessions < 1:
            raise SettingsError("chat settings: max_sessions must be at least 1.")
        if not 0 <= self.idle_minutes < math.inf:
            raise SettingsError("chat settings: idle_minutes must be 0 (never) or more.")
        check_tools(self.tools, self.allow)


def read_settings(path: Path | None) -> ChatSettings:
    """Reads a settings file; the defaults where there is none.

    Raises:
        SettingsError: If the file is missing, malformed, or has unknown or wrong entries.
    """
    return ChatSettings() if path is None else filled(ChatSettings, _parse(path), str(path))


def filled(kind: type[T], values: Mapping[str, Any], where: str) -> T:
    """A dataclass of settings with some values set.

    Args:
        kind: Its fields are numbers, words, truth values, lists of words, tables of anything, such
            dataclasses or lists of them.
        values: By name of the field, as TOML and JSON give them.
        where: What an error names as the place.

    Raises:
        SettingsError: If a name is unknown or a value is of the wrong type.
    """
    fields = {f.name: f.type for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    for name in values:
        if name not in fields:
            raise SettingsError(f"{where}: there is no setting '{name}', use {_any_of(fields)}.")
    for name in _required(kind):
        if name not in values:
            raise SettingsError(f"{where}: '{name}' is missing.")
    return kind(**{name: _value(fields[name], v, where, name) for name, v in values.items()})


def _value(kind: Any, value: Any, where: str, name: str) -> Any:
    kind = _given(kind)
    if kind is Choice:
        return _choice(value, where, name)
    if dataclasses.is_dataclass(kind) and isinstance(value, dict):
        return filled(kind, value, f"{where} [{name}]")  # type: ignore[arg-type]
    entry_kind = entry_kind_of(kind)
    if entry_kind is not None and isinstance(value, list):
        if all(isinstance(entry, dict) for entry in value):
            return tuple(filled(entry_kind, entry, f"{where} [[{name}]]") for entry in value)
    elif kind == tuple[str, ...] and isinstance(value, list):
        if all(isinstance(entry, str) for entry in value):
            return tuple(value)
    elif get_origin(kind) is Mapping and isinstance(value, dict):
        return value
    elif kind is float and type(value) is int:
        return float(value)
    elif type(value) is kind:
        return value
    raise SettingsError(f"{where}: '{name}' must be {described(kind)}.")


def _given(kind: Any) -> Any:
    """The type of a setting that may be left out, where it is given."""
    kinds = [one for one in get_args(kind) if one is not type(None)]
    return kinds[0] if isinstance(kind, UnionType) and len(kinds) == 1 else kind


def entry_kind_of(kind: Any) -> Any:
    """The dataclass of which a setting is a list, if it is one."""
    entry = get_args(kind)[0] if get_origin(kind) is tuple else None
    return entry if dataclasses.is_dataclass(entry) else None


def _required(kind: Any) -> list[str]:
    missing = dataclasses.MISSING
    fields = dataclasses.fields(kind)
    return [f.name for f in fields if f.default is missing and f.default_factory is missing]


def _choice(value: Any, where: str, name: str) -> Choice:
    if isinstance(value, str):
        return Choice(value)
    if not isinstance(value, dict) or not isinstance(value.get("use", BEST), str):
        raise SettingsError(f"{where}: '{name}' must be {described(Choice)}.")
    options = {key: entry for key, entry in value.items() if key != "use"}
    return Choice(value.get("use", BEST), options)


def described(kind: Any) -> str:
    """The type of a setting, for people."""
    kind = _given(kind)
    if kind is Choice:
        return "a provider's name or a table with 'use'"
    if kind == tuple[str, ...]:
        return "a list of texts"
    if entry_kind_of(kind) is not None:
        return "a list of tables"
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
