"""Texts of the settings in which `$NAME` stands for an environment variable: headers and the like.

So a settings file names keys and holds none. They are looked up when they are sent.
"""

import os
import re
from collections.abc import Iterable, Mapping
from string import Template

from ico3d.chat.settings.keys import check_key
from ico3d.errors import SettingsError

HEADER = re.compile(r"[A-Za-z0-9!#$%&'*+.^_`|~-]{1,100}")
SENDABLE = re.compile(r"[\x20-\x7e]*")
SHORTEST_KEY = 8
"""Letters of a key; shorter values are no secrets, and would blank parts of other words."""


def check_headers(url: str, headers: Mapping[str, str], where: str) -> None:
    """Checks headers, and whether the keys in them may be sent to an address.

    Args:
        url: Address to which the headers go.
        headers: Values by name, with `$NAME` for environment variables.
        where: Name of the setting, for errors.

    Raises:
        SettingsError: If a header cannot be sent, or a key would be sent unencrypted to another
            machine.
    """
    for name in headers:
        if not HEADER.fullmatch(name):
            raise SettingsError(f"{where}: {name[:40]!r} is no name of a header.")
    for variable in variables(headers.values(), where):
        check_key(url, variable, where)


def variables(texts: Iterable[str], where: str) -> list[str]:
    """The environment variables that stand in texts.

    Raises:
        SettingsError: If a `$` is followed by no name; `$$` stands for a dollar.
    """
    templates = [Template(text) for text in texts]
    if not all(template.is_valid() for template in templates):
        raise SettingsError(f"{where}: write $NAME for an environment variable, $$ for a dollar.")
    return [name for template in templates for name in template.get_identifiers()]


def filled_in(texts: Mapping[str, str], where: str) -> dict[str, str]:
    """Texts with the values of their environment variables.

    Raises:
        SettingsError: If a variable is not set, or a value has characters that no header can have.
    """
    for name in variables(texts.values(), where):
        value = os.environ.get(name, "")
        if not value:
            raise SettingsError(f"{where} needs {name} in the environment.")
        if not SENDABLE.fullmatch(value):
            raise SettingsError(f"{where}: {name} in the environment holds more than plain text.")
    return {key: Template(text).substitute(os.environ) for key, text in texts.items()}


def blanked(text: str, texts: Mapping[str, str], where: str) -> str:
    """A server's words without the keys that it was sent: some repeat them in complaints."""
    for name in variables(texts.values(), where):
        key = os.environ.get(name, "")
        if len(key) >= SHORTEST_KEY:
            text = text.replace(key, "…")
    return text
