"""Settings of a conversation, read from one file: services, turns, time limits and tools."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

from ico3d.chat.settings.embedding import Embedding
from ico3d.chat.settings.keys import check_key
from ico3d.chat.settings.mcp import McpServer, check_servers
from ico3d.chat.settings.tools import Tool, check_tools
from ico3d.chat.settings.visits import Visits
from ico3d.common.typed import NAMES, Kind, Rules, fill, kind_of, loose_json, parse_toml
from ico3d.errors import SettingsError

MOST_BYTES = 1 << 20
"""Size of a settings file; a link to a device has no end."""
BEST = "best"
"""Name that stands for the best service that works on this machine without further settings."""
T = TypeVar("T")


@dataclass(frozen=True)
class Choice:
    """The choice of a service: a table of the settings file, or the name of a provider alone.

    Attributes:
        use: Name of the provider, or `best`.
        options: Options of the provider by name: all other keys of the table.
    """

    use: str = BEST
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Turns:
    """Who speaks when: the table `[turns]`.

    Attributes:
        pause: Seconds of silence after which the end of a turn is considered.
        end_silence: Seconds of silence that end a turn even if it sounded unfinished.
        speculate: Whether to prepare an answer as soon as the turn may be over. It is spoken only
            if the turn really was over. Costs one request for each pause within a turn.
        interrupt_after: Seconds that a voice must last to interrupt the avatar.
        longest_backchannel: Seconds after which even "uh-huh" and humming interrupt the avatar.
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
    """How long services may take before the avatar says something: the table `[patience]`.

    Attributes:
        language: Seconds until the first words of an answer, and between two pieces of it.
        reasoning: Seconds that a model may think before the first words, as long as it shows that
            it is thinking.
        voice: Seconds until the first sound of a sentence, and between two pieces of it.
        tool: Seconds that a tool may take before the avatar asks for a moment, once in an
            answer; 0 for never.
        apologies: Language in which the avatar apologises, such as `de`; empty for the persona's
            first language. English for languages without apologies.
    """

    language: float = 12.0
    reasoning: float = 60.0
    voice: float = 8.0
    tool: float = 1.0
    apologies: str = ""

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If there is no patience at all.
        """
        if min(self.language, self.reasoning, self.voice) < 0.1:
            raise SettingsError("chat settings: [patience] needs at least 0.1 seconds for each.")
        if self.tool < 0:
            raise SettingsError("chat settings: [patience] tool must be 0 (never) or more.")


@dataclass(frozen=True)
class Expression:
    """Where sound becomes a moving face: the table `[expression]`.

    Attributes:
        use: `own`: the avatar's speech model runs in this process; `remote`: the same model runs on
            another machine, and in this process whenever that machine fails.
        url: Address of `ico3d serve-module expression`, such as `http://127.0.0.1:8766` for a
            tunnel's local end.
        key_variable: Environment variable that holds the module's key, if it needs one. A key is
            never sent unencrypted to another machine.
        timeout: Seconds that the module may take for a piece of sound before this process takes
            over.
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
    """How much of a conversation the language model remembers: the table `[memory]`.

    Attributes:
        tokens: Approximate length of the conversation, without the system instruction, beyond which
            all but the latest messages are summarised.
        visits: Whether pages may remember visitors who agree: what they said is kept in their own
            browsers, and told to the language model at their next visit.
    """

    tokens: int = 4000
    visits: bool = False

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If nothing could be remembered.
        """
        if self.tokens < 200:
            raise SettingsError("chat settings: [memory] needs at least 200 tokens.")


@dataclass(frozen=True)
class ChatSettings:
    """Settings of a conversation; the file may be TOML or JSON.

    Attributes:
        recognition: Speech to text.
        language: Question to answer.
        voice: Text to speech.
        turns: Who speaks when.
        patience: Time limits of services.
        expression: Where the face is computed from sound.
        max_sessions: How many visitors may talk at once, including those whose connection was lost
            a moment ago.
        idle_minutes: A session ends after this time without speech, typing or playback; 0 for
            never.
        gestures: Whether the body gestures during speech; otherwise it stays at rest.
        memory: How much of the conversation is remembered.
        limits: How much visitors may take.
        embedding: Who may put the avatar into their pages ([more](conversation/embedding.md)).
        tools: Functions over HTTP that the language model may call.
        mcp: Servers of the Model Context Protocol, whose functions it may call, too.
        allow: Hosts that tools may call, such as `api.example.org` or `127.0.0.1:9000`; private
            addresses must be listed as such.
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
    limits: Visits = Visits()
    embedding: Embedding = Embedding()
    tools: tuple[Tool, ...] = ()
    mcp: tuple[McpServer, ...] = ()
    allow: tuple[str, ...] = ()

    def __post_init__(self):
        """Checks ranges.

        Raises:
            SettingsError: If the limits of sessions make no sense, or a tool or server does not.
        """
        if self.max_sessions < 1:
            raise SettingsError("chat settings: max_sessions must be at least 1.")
        if not 0 <= self.idle_minutes < math.inf:
            raise SettingsError("chat settings: idle_minutes must be 0 (never) or more.")
        check_tools(self.tools, self.allow)
        check_servers(self.mcp, self.allow)


def read_settings(path: Path | None) -> ChatSettings:
    """Reads a settings file; without a file, returns the defaults.

    Raises:
        SettingsError: If the file is missing or malformed, or has unknown keys or invalid values.
    """
    return ChatSettings() if path is None else filled(ChatSettings, _parse(path), str(path))


def filled(kind: type[T], values: Mapping[str, Any], where: str) -> T:
    """A dataclass of settings, filled from parsed TOML or JSON.

    Args:
        kind: The dataclass; its fields are numbers, texts, truth values, lists of texts, free
            tables, other such dataclasses or lists of them.
        values: Values by name of the field.
        where: Name of the file or table, for errors.

    Raises:
        SettingsError: If a name is unknown or a value has the wrong type.
    """
    return fill(kind, dict(values), Setting(where), SettingsRules(SettingsError))


@dataclass(frozen=True)
class Setting:
    """The place of a setting, for errors.

    Attributes:
        table: Name of the file and of the table within.
        name: Name of the setting; empty for a table as a whole.
        kind: Type of the setting's value.
    """

    table: str
    name: str = ""
    kind: Any = None

    @property
    def inner(self) -> str:
        """Name of the table, if the setting is one."""
        if not self.name:
            return self.table
        name = f"[[{self.name}]]" if entry_kind_of(self.kind) else f"[{self.name}]"
        return f"{self.table} {name}"


class SettingsRules(Rules):
    """Rules for settings: they may be left out, and errors list what exists."""

    defaults, null, finite, entries = True, False, False, False

    def field(self, where: Setting, name: str, kind: Kind) -> Setting:
        """The place of a setting in a table."""
        return Setting(where.inner, name, kind.bare)

    def unknown(self, where: Setting, name: str, kind: type) -> str:
        """The sentence for a name that is no setting."""
        names = " or ".join(field.name for field in dataclasses.fields(kind))
        return f"{where.inner}: there is no setting '{name[:40]}', use {names}."

    def missing(self, where: Setting, name: str) -> str:
        """The sentence for a missing required setting."""
        return f"{where.inner}: '{name}' is missing."

    def wrong(self, where: Setting, kind: Kind, value: Any) -> str:
        """The sentence for a value of the wrong type."""
        return f"{where.table}: '{where.name}' must be {described(where.kind)}."

    def own(self, kind: Kind, value: Any, where: Setting) -> Any:
        """Converts a `Choice`, which may be given as a name alone.

        Raises:
            SettingsError: If the value is neither a name nor a table whose `use`, if given, is a
                name.
        """
        if kind.bare is not Choice:
            return NotImplemented
        if isinstance(value, str):
            return Choice(value)
        if not isinstance(value, dict) or not isinstance(value.get("use", BEST), str):
            raise SettingsError(self.wrong(where, kind, value))
        options = {key: entry for key, entry in value.items() if key != "use"}
        return Choice(value.get("use", BEST), options)


def entry_kind_of(kind: Any) -> Any:
    """The dataclass of a list's entries, if the setting is a list of tables, else None."""
    entry = get_args(kind)[0] if get_origin(kind) is tuple else None
    return entry if dataclasses.is_dataclass(entry) else None


def described(kind: Any) -> str:
    """The type of a setting, in words for users."""
    kind = kind_of(kind).optional or kind
    if kind is Choice:
        return "a provider's name or a table with 'use'"
    if kind == tuple[str, ...]:
        return "a list of texts"
    if entry_kind_of(kind) is not None:
        return "a list of tables"
    return NAMES.get(kind, "a table")


def _parse(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise SettingsError(f"{path}: is larger than {MOST_BYTES} bytes.")
        text = data.decode("utf-8").replace("\r\n", "\n")
        values = loose_json(text) if path.suffix == ".json" else parse_toml(text)
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read ({error.strerror}).") from error
    except (ValueError, RecursionError) as error:
        raise SettingsError(f"{path}: {error}.") from error
    if not isinstance(values, dict):
        raise SettingsError(f"{path}: must hold names and values.")
    return values
