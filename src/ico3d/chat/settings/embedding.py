"""Settings of avatars in other people's pages."""

import re
from dataclasses import dataclass
from urllib.parse import urlsplit

from ico3d.errors import SettingsError

SITE = re.compile(r"https?://(\[[0-9a-f:.]+\]|[a-z0-9_.-]+)(:\d{1,5})?")
"""An origin as browsers write it, in small letters and without a path."""
DEFAULT_PORTS = {"http": 80, "https": 443}


@dataclass(frozen=True)
class Embedding:
    """Who may put the avatar into pages of their own: the table `[embedding]`.

    Attributes:
        origins: Sites that may, such as `https://example.org`; `ico3d serve --allow-origin` adds
            some.
        key_variable: Environment variable that holds the key of tokens; empty for no tokens. With
            a key nobody loads the avatar or talks without a token, not even on the server's page.
        token_minutes: Minutes for which a token admits.
        say: Whether pages may have the avatar say any text, which uses the voice as text to speech.
    """

    origins: tuple[str, ...] = ()
    key_variable: str = ""
    token_minutes: float = 10.0
    say: bool = False

    def __post_init__(self):
        """Checks the sites and the time.

        Raises:
            SettingsError: If an origin is none, or tokens would never or always admit.
        """
        for origin in self.origins:
            check_origin(origin)
        if not 1 <= self.token_minutes <= 24 * 60:
            raise SettingsError("chat settings: [embedding] token_minutes must be 1 to 1440.")


def check_origin(origin: str) -> None:
    """Checks that a text is an origin as browsers send it.

    Raises:
        SettingsError: If it is not.
    """
    if SITE.fullmatch(origin):
        parts = urlsplit(origin)
        port = int(origin.rpartition(":")[2]) if re.search(r":\d+$", origin) else None
        if port != DEFAULT_PORTS[parts.scheme] and (port is None or 0 < port < 65536):
            return
    raise SettingsError(
        f"'{origin}' is no site: write it as its pages' address begins, such as "
        "https://example.org or http://localhost:3000, without a path."
    )
