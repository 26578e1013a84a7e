"""Other sites that may show the avatar, and the tokens with which pages are admitted."""

import base64
import hmac
import os
import secrets
import time
from collections.abc import Callable
from urllib.parse import parse_qs

from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse
from starlette.types import Scope

from ico3d.chat.serving import tokens
from ico3d.chat.serving.crowd import Meters, machine_of
from ico3d.chat.settings.embedding import Embedding, check_origin
from ico3d.errors import SettingsError

EMBEDDED = ("/ws", "/embed.js", "/assets/", "/bundle/")
"""What listed sites may load: a path, or all below it."""
PROTECTED = ("/ws", "/bundle/", "/recordings/")
"""What needs a token where there is a key."""
SHORTEST_KEY = 16  # characters
OWN_KEY = 16  # characters of a key that a server makes itself: 80 bits
WRONG, WRONG_AT_ONCE = 0.1, 10  # keys of one machine that may be wrong, per second and at once
TOKEN_ROUTE = "/token"


class Sites:
    """Decides which sites may load what, and whose tokens admit."""

    def __init__(
        self,
        embedding: Embedding | None = None,
        key: str = "",
        now: Callable[[], float] = time.time,
    ):
        """Takes the settings; by default nobody may embed and nobody needs a token.

        Args:
            embedding: Sites and times.
            key: Secret with which tokens are signed; empty for none.
            now: Returns Unix time in seconds.
        """
        self._embedding, self._key, self._now = embedding or Embedding(), key, now

    @property
    def any(self) -> bool:
        """Whether some site may embed the avatar, so that strangers may talk with it."""
        return bool(self._embedding.origins)

    @property
    def ancestors(self) -> str:
        """Sites that may frame the page, for the policy `frame-ancestors`."""
        return " ".join(self._embedding.origins) or "'none'"

    @property
    def asks_for_tokens(self) -> bool:
        """Whether only pages with a token may talk."""
        return bool(self._key)

    def permits(self, origin: str | None, path: str) -> bool:
        """Whether pages of another site may load a path."""
        return origin in self._embedding.origins and is_embedded(path)

    def admits(self, scope: Scope, origin: str | None) -> bool:
        """Whether a request has the token that it needs, if it needs one.

        Args:
            scope: The request.
            origin: The other site that it comes from; None for the server's own page.
        """
        if not self._key or not _is_below(scope["path"], PROTECTED):
            return True
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        return tokens.is_valid(given, self._key, origin or "", self._now())

    def headers(self, origin: str | None, path: str) -> dict[str, str]:
        """Headers that let a site's pages use an answer; none for other sites."""
        shared = {"Vary": "Origin"} if self._embedding.origins and is_embedded(path) else {}
        if not self.permits(origin, path):
            return shared
        return shared | {
            "Access-Control-Allow-Origin": str(origin),
            "Cross-Origin-Resource-Policy": "cross-origin",
        }

    def token(self, origin: str) -> tuple[str, int]:
        """A new token for a site, or for the server's own page if empty, and when it expires.

        Raises:
            SettingsError: If there is no key, or the site may not embed the avatar.
        """
        if not self._key:
            raise SettingsError("the settings name no key_variable in [embedding]: no tokens.")
        if origin:
            check_origin(origin)
            if origin not in self._embedding.origins:
                raise SettingsError(f"{origin} is not among the origins that may embed the avatar.")
        expires = int(self._now() + 60 * self._embedding.token_minutes)
        return tokens.sign(self._key, origin, expires), expires

    def is_key(self, given: str) -> bool:
        """Whether a text is the server's key."""
        return bool(self._key) and hmac.compare_digest(given.encode(), self._key.encode())


def own_key() -> str:
    """A new key that can be read aloud and typed: groups of four letters and digits."""
    text = base64.b32encode(secrets.token_bytes(OWN_KEY * 5 // 8)).decode().lower()
    return "-".join(text[at : at + 4] for at in range(0, OWN_KEY, 4))


def shown_key(is_public: bool, is_open: bool, embedding: Embedding) -> str | None:
    """The key that visitors have to show, as far as the operator has to be told.

    Args:
        is_public: Whether others than users of this machine can come.
        is_open: Whether everybody is admitted.
        embedding: Names the operator's own key, if there is one.

    Returns:
        A new key; empty for the operator's own; None if none is asked for.

    Raises:
        SettingsError: If everybody is admitted and a key is asked for.
    """
    if embedding.key_variable and is_open:
        raise SettingsError(
            "--open admits everybody, but [embedding] asks for the key in "
            f"{embedding.key_variable}: leave out one of them."
        )
    if embedding.key_variable:
        return ""
    return own_key() if is_public and not is_open else None


def open_sites(embedding: Embedding, default: str = "") -> Sites:
    """The sites of the settings, with the key from the environment.

    Args:
        embedding: The settings.
        default: The key where the settings name none; empty for no key.

    Raises:
        SettingsError: If the key is missing or short.
    """
    variable = embedding.key_variable
    key = os.environ.get(variable, "") if variable else default
    if variable and len(key) < SHORTEST_KEY:
        raise SettingsError(
            f"[embedding] needs a key of {SHORTEST_KEY} characters or more in the environment as "
            f"{variable}; `openssl rand -hex 32` makes one."
        )
    return Sites(embedding, key)


def add_tokens(app: FastAPI, sites: Sites) -> None:
    """Adds the route that gives tokens to those who have the key: visitors, backends of sites."""
    wrong = Meters(WRONG, WRONG_AT_ONCE, time.monotonic)

    @app.post(TOKEN_ROUTE)
    async def token(request: Request, origin: str = "") -> Response:
        given = request.headers.get("authorization", "").removeprefix("Bearer ").strip()
        guesses = wrong.of(machine_of(request.scope.get("client")))
        if not all(bucket.has(1) for bucket in guesses):
            return JSONResponse({"error": "too many wrong keys: wait a minute."}, 429)
        if not sites.is_key(given):
            for bucket in guesses:
                bucket.take(1)
            return JSONResponse({"error": "the key is missing or wrong."}, 401)
        try:
            text, expires = sites.token(origin)
        except SettingsError as error:
            return JSONResponse({"error": str(error)}, 400)
        headers = {"Cache-Control": "no-store"}
        return JSONResponse({"token": text, "expires": expires}, headers=headers)


def is_embedded(path: str) -> bool:
    """Whether a path is of what sites embed."""
    return _is_below(path, EMBEDDED)


def _is_below(path: str, places: tuple[str, ...]) -> bool:
    return any(path == place or (place[-1] == "/" and path.startswith(place)) for place in places)
