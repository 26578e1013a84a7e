"""Decides which key is sent to which server.

A key is the secret of one server. A key that the settings name for an address is sent there.
OpenAI's own key is sent to OpenAI's address by default, and nowhere else by default. No key is sent
unencrypted, except on this machine.
"""

import ipaddress
import os
import re

from ico3d.errors import SettingsError

OPENAI_HOST = "api.openai.com"
OPENAI = f"https://{OPENAI_HOST}/v1"
OPENAI_KEY = "OPENAI_API_KEY"
NONE = "none"
"""Sent in place of a missing key, because clients need some key."""
_ADDRESS = re.compile(
    r"(?P<scheme>https?)://(?P<host>\[[0-9a-f:.]+\]|[\w.-]+)(?P<port>:\d{1,5})?([/?#][!-~]*)?",
    re.IGNORECASE,
)
"""An address that every parser reads in one way: no user's name, no backslash, no white space."""


def check_key(url: str, key_variable: str, where: str) -> None:
    """Checks an address, and whether a key may be sent there.

    Args:
        url: Address of a server; empty for OpenAI's.
        key_variable: Environment variable with the server's key; may be empty.
        where: Name of the setting, for errors.

    Raises:
        SettingsError: If the address is invalid, or a key would be sent unencrypted to another
            machine.
    """
    found = _ADDRESS.fullmatch(url or OPENAI)
    if found is None:
        raise SettingsError(
            f"{where}: url must be an address such as https://gpu-box/v1, without a user's name."
        )
    safe = found["scheme"].lower() == "https" or is_this_machine(found["host"])
    if key_variable and not safe:
        raise SettingsError(
            f"{where}: the key in {key_variable} would be sent unencrypted to {found['host']}: "
            "use https, or a tunnel to this machine (docs/conversation/modules.md)."
        )


def key_for(url: str, key_variable: str, where: str) -> str:
    """The key for a server; empty for none.

    Args:
        url: Address of the server; empty for OpenAI's.
        key_variable: Environment variable with the server's key; may be empty.
        where: Name of the setting, for errors.

    Raises:
        SettingsError: If `check_key` refuses the address, or the environment variable is not set.
    """
    check_key(url, key_variable, where)
    variable = key_variable or (OPENAI_KEY if is_openai(url) else "")
    key = os.environ.get(variable, "") if variable else ""
    if variable and not key:
        raise SettingsError(f"{where} needs its key in the environment as {variable}.")
    return key


def goes_here(url: str) -> bool:
    """Whether an address is on this machine."""
    found = _ADDRESS.fullmatch(url)
    return found is not None and is_this_machine(found["host"])


def is_openai(url: str) -> bool:
    """Whether an address is OpenAI's own, to which OpenAI's key belongs."""
    found = _ADDRESS.fullmatch(url or OPENAI)
    if found is None or found["scheme"].lower() != "https" or found["port"] not in (None, ":443"):
        return False
    host = found["host"].lower()
    return host == OPENAI_HOST or host.endswith(f".{OPENAI_HOST}")


def is_this_machine(host: str) -> bool:
    """Whether a host name in an address can only be this machine."""
    try:
        ip = ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return host.lower() == "localhost"
    mapped = ip.ipv4_mapped if isinstance(ip, ipaddress.IPv6Address) else None
    return (mapped or ip).is_loopback
