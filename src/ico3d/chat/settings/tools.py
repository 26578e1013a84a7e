"""Settings of functions over HTTP for the language model: the tables `[[tools]]`."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from string import Formatter
from typing import Any
from urllib.parse import SplitResult, urlsplit

from ico3d.chat.settings.headers import check_headers
from ico3d.errors import SettingsError

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")
OWN = ("gesture", "mood")
PORTS = {"http": 80, "https": 443}


@dataclass(frozen=True)
class Tool:
    """A function over HTTP that the language model may call.

    Attributes:
        name: Name of the function, for the model.
        description: When to call the function and what it returns, for the model.
        url: Address, `http` or `https`, with a host that is listed in `allow`; `{parameter}` in
            path or query is replaced by the parameter's value.
        method: `GET` (other parameters are added to the query) or `POST` (they form a JSON body).
        parameters: JSON schema of the parameters, of type `object`.
        seconds: Time limit of a call, s.
        headers: Headers of each call, such as `{ Authorization = "Bearer $MUSEUM_KEY" }`; `$NAME`
            stands for an environment variable. A key is never sent unencrypted to another machine.
    """

    name: str
    description: str
    url: str
    method: str = "GET"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 5.0
    headers: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self):
        """Checks it.

        Raises:
            SettingsError: In one sentence, if something makes no sense.
        """
        where = self.where
        named = NAME.fullmatch(self.name) and self.name not in OWN
        _require(named, where, f"needs another name: letters, digits, _ and -, and none of {OWN}")
        _require(self.description.strip(), where, "needs a description")
        _require(self.method in ("GET", "POST"), where, "has a method other than GET or POST")
        _require(0 < self.seconds <= 60, where, "must have between 0 and 60 seconds")
        _require(
            _is_schema(self.parameters), where, "needs a JSON schema of an object's properties"
        )
        parts = _split(self.url)
        plain = parts and parts.scheme in PORTS and parts.hostname and "@" not in parts.netloc
        _require(plain, where, "needs an http or https URL without a user's name")
        _require(
            "{" not in self.url.partition("://")[2].split("/")[0], where, "has a variable host"
        )
        missing = [name for name in self.placeholders if name not in self.required]
        _require(not missing, where, "must require every parameter that its URL has in braces")
        check_headers(self.url, self.headers, where)

    @property
    def where(self) -> str:
        """The tool's place in the settings, for errors."""
        return f"chat settings: tool {self.name[:80]!r}"

    @property
    def properties(self) -> dict[str, Any]:
        """Schema of each parameter, by name."""
        return dict(self.parameters.get("properties", {}))

    @property
    def required(self) -> list[str]:
        """Names of required parameters."""
        return list(self.parameters.get("required", []))

    @property
    def placeholders(self) -> list[str]:
        """Names of parameters that are part of the URL."""
        return [name for _, name, _, _ in Formatter().parse(self.url) if name is not None]


def check_tools(tools: tuple[Tool, ...], allow: tuple[str, ...]) -> None:
    """Checks that tools have different names and listed hosts.

    Raises:
        SettingsError: If two tools have the same name, or a host is not listed.
    """
    names, hosts = [tool.name for tool in tools], {host.lower() for host in allow}
    for tool in tools:
        where = tool.where
        _require(names.count(tool.name) == 1, where, "is there twice")
        host = host_of(urlsplit(tool.url))
        _require(host in hosts, where, f"calls {host}, which is not in 'allow'")


def host_of(url: SplitResult) -> str:
    """The host as listed in `allow`: with the port unless it is the default one."""
    name = (url.hostname or "").lower()
    shown = f"[{name}]" if ":" in name else name
    return shown if url.port in (None, PORTS.get(url.scheme)) else f"{shown}:{url.port}"


def _split(url: str) -> SplitResult | None:
    try:
        parts = urlsplit(url)
        _ = parts.port  # raises where it is no number
        list(Formatter().parse(url))  # and where braces do not match
    except ValueError:
        return None
    return parts


def _is_schema(value: Mapping[str, Any]) -> bool:
    properties, required = value.get("properties", {}), value.get("required", [])
    if value.get("type", "object") != "object" or not isinstance(properties, Mapping):
        return False
    tables = all(isinstance(entry, Mapping) for entry in properties.values())
    return tables and isinstance(required, list) and all(name in properties for name in required)


def _require(holds: Any, where: str, what: str) -> None:
    if not holds:
        raise SettingsError(f"{where} {what}.")
