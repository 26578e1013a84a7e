"""Options for clients of OpenAI-compatible servers: each server gets only its own key.

Importing this module is slow.
"""

import os
from functools import partial
from typing import Any

from openai import DefaultAsyncHttpxClient

from ico3d.chat.services.bounded import NoCookies, ask_plain, bound
from ico3d.chat.services.tls import client_context
from ico3d.chat.settings.keys import NONE, OPENAI, goes_here, is_openai, key_for

OWN_HEADERS = ("OpenAI-Organization", "OpenAI-Project")
"""Headers that the SDK takes from the environment and sends to every server."""
CUSTOM_HEADERS = "OPENAI_CUSTOM_HEADERS"
"""Environment variable with further such headers, one `Name: value` per line."""


def client_options(
    url: str, key_variable: str, where: str, most: int | None = None, **http: Any
) -> dict[str, Any]:
    """Options of the SDK's client for one server.

    Redirects are not followed, so that neither key nor words reach another server. Servers on this
    machine are not asked through a proxy. What they answer is bounded.

    Args:
        url: Address of the server; empty for OpenAI's.
        key_variable: Environment variable with the server's key, or empty.
        where: Place of the setting, for errors.
        most: Bytes that an answer may have; by default those of `bounded`.
        http: Options of the HTTP client.

    Raises:
        SettingsError: If the key is missing or may not be sent to this address.
    """
    key = key_for(url, key_variable, where) or NONE
    own = [] if is_openai(url) else [_without_openais(key)]
    hooks = {"request": [ask_plain, *own], "response": [partial(bound, most=most)]}
    trusting = not goes_here(url)
    # Without TLS, certificates would be read for nothing.
    verify = False if url.startswith("http:") else client_context(trusting)
    client = DefaultAsyncHttpxClient(
        follow_redirects=False,
        verify=verify,
        trust_env=trusting,
        event_hooks=hooks,
        cookies=NoCookies(),
        **http,
    )
    return {"api_key": key, "base_url": url or OPENAI, "http_client": client}


def _without_openais(key: str):
    """A hook that leaves in a request nothing that the environment holds for OpenAI."""
    lines = os.environ.get(CUSTOM_HEADERS, "").splitlines()
    names = (*OWN_HEADERS, *(line.partition(":")[0].strip() for line in lines))

    async def checked(request: Any) -> None:
        for name in names:
            request.headers.pop(name, None)
        request.headers["Authorization"] = f"Bearer {key}"

    return checked
