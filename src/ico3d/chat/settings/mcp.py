"""Settings of servers whose functions the language model may call: the tables `[[mcp]]`."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from ico3d.chat.settings.headers import check_headers, variables
from ico3d.chat.settings.keys import check_key
from ico3d.chat.settings.tools import host_of
from ico3d.errors import SettingsError

NAME = re.compile(r"[A-Za-z][A-Za-z0-9]{0,19}")
VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass(frozen=True)
class McpServer:
    """A server of the Model Context Protocol: a program on this machine, or an address.

    Attributes:
        name: Name of the server; the model sees its functions as `NAME_FUNCTION`.
        command: Program and arguments of a server that speaks over standard input and output; it
            is started for each visitor and ends with the visit.
        url: Address of a server that speaks streamable HTTP, with a host that is listed in `allow`.
        headers: Headers of each request, such as `{ Authorization = "Bearer $MUSEUM_KEY" }`;
            `$NAME` stands for an environment variable. A key is never sent unencrypted to another
            machine.
        environment: Environment variables of the program, such as `{ MUSEUM_KEY = "$MUSEUM_KEY" }`;
            besides these it gets only `PATH`, `HOME` and the like.
        functions: Names of the functions that the model may call; empty for all.
        seconds: Time limit of a call, and of connecting, s.
    """

    name: str
    command: tuple[str, ...] = ()
    url: str = ""
    headers: Mapping[str, str] = field(default_factory=dict)
    environment: Mapping[str, str] = field(default_factory=dict)
    functions: tuple[str, ...] = ()
    seconds: float = 10.0

    def __post_init__(self):
        """Checks it.

        Raises:
            SettingsError: In one sentence, if something makes no sense.
        """
        where = self.where
        if not NAME.fullmatch(self.name):
            raise SettingsError(f"{where} needs another name: up to 20 letters and digits.")
        if bool(self.url) == bool(self.command):
            raise SettingsError(f"{where} needs either a command or a url.")
        if not 0 < self.seconds <= 60:
            raise SettingsError(f"{where} must have between 0 and 60 seconds.")
        if (self.command and self.headers) or (self.url and self.environment):
            raise SettingsError(f"{where}: headers belong to a url, environment to a command.")
        if not all(VARIABLE.fullmatch(name) for name in self.environment):
            raise SettingsError(f"{where}: an environment variable has a name that none can have.")
        variables(self.environment.values(), where)
        if self.url:
            check_key(self.url, "", where)
            check_headers(self.url, self.headers, where)

    @property
    def where(self) -> str:
        """The server's place in the settings, for errors."""
        return f"chat settings: mcp {self.name[:40]!r}"

    @property
    def secrets(self) -> Mapping[str, str]:
        """The texts that may hold keys."""
        return self.headers if self.url else self.environment


def check_servers(servers: tuple[McpServer, ...], allow: tuple[str, ...]) -> None:
    """Checks that servers have different names and listed hosts.

    Raises:
        SettingsError: If two servers have the same name, or a host is not listed.
    """
    names, hosts = [server.name for server in servers], {host.lower() for host in allow}
    for server in servers:
        if names.count(server.name) > 1:
            raise SettingsError(f"{server.where} is there twice.")
        host = host_of(urlsplit(server.url))
        if server.url and host not in hosts:
            raise SettingsError(f"{server.where} calls {host}, which is not in 'allow'.")
