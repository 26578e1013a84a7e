"""How servers with an OpenAI-compatible API are called: by their own key, and never led elsewhere.

Slow to import.
"""

import os
from typing import Any

from openai import DefaultAsyncHttpxClient

from ico3d.chat.settings.keys import NONE, OPENAI, goes_here, is_openai, key_for

OWN_HEADERS = ("OpenAI-Organization", "OpenAI-Project")
"""What the SDK takes from the environment and sends to every server."""
CUSTOM_HEADERS = "OPENAI_CUSTOM_HEADERS"
"""Environment variable with more of them, one `Name: value` a line."""


def client_options(url: str, key_variable: str, where: str, **http: Any) -> dict[str, Any]:
    """What the SDK's client is made with for one server.

    It follows no redirects: neither key nor words go anywhere else. Servers of this machine are
    not asked through a proxy.

    Args:
        url: Of the server; empty for OpenAI's.
        key_variable: Environment variable that the settings name for its key; may be empty.
        where: What an error names as the place.
        http: Options of the HTTP client.

    Raises:
        SettingsError: If the key is missing or must not go there.
    """
    key = key_for(url, key_variable, where) or NONE
    hooks = {} if is_openai(url) else {"request": [_without_openais(key)]}
    client = DefaultAsyncHttpxClient(
        follow_redirects=False, trust_env=not goes_here(url), event_hooks=hooks, **http
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
