"""Lists the models of OpenAI-compatible servers, with a time limit."""

import asyncio
import re
import ssl
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import httpx

from ico3d.common.typed import loose_json

OTHERS = re.compile(r"embed|rerank|whisper|speech|tts|kokoro|piper|transcri", re.IGNORECASE)
"""Parts of names of models that are no language models."""
MOST_BYTES = 1 << 20  # of a list of models


def language_models(url: str, key: str, seconds: float) -> list[str]:
    """Names of a server's language models; empty if it does not answer as expected.

    Args:
        url: Address of the server, usually ending in `/v1`.
        key: The key, sent as bearer token.
        seconds: Time limit.
    """
    try:
        listed = loose_json(asyncio.run(_read(url.rstrip("/") + "/models", key, seconds)))
    except (httpx.HTTPError, httpx.InvalidURL, TimeoutError, ValueError):
        return []
    entries = listed.get("data") if isinstance(listed, dict) else None
    names = [_name(entry) for entry in entries] if isinstance(entries, list) else []
    return [name for name in names if name and not OTHERS.search(name)]


def first_server(urls: list[str], seconds: float) -> tuple[str, str] | None:
    """The first server in the list that offers a language model, and its first model; or None.

    Args:
        urls: Addresses, the preferred one first; all are asked at the same time.
        seconds: Time limit.
    """
    pool = ThreadPoolExecutor(len(urls), "language")
    asked = [pool.submit(language_models, url, "none", seconds) for url in urls]
    wait(asked, timeout=seconds)
    pool.shutdown(wait=False)
    for url, names in zip(urls, asked, strict=True):
        if names.done() and names.result():
            return url, names.result()[0]
    return None


async def _read(url: str, key: str, seconds: float) -> bytes:
    """An answer; nothing leads elsewhere, and nothing is unpacked.

    Raises:
        HTTPError: If there is none.
        TimeoutError: If it is too long, or is not whole in time, however its head drips.
    """
    data = b""
    headers = {"Authorization": f"Bearer {key}", "Accept-Encoding": "identity"}
    # Without TLS certificates would be read for nothing, which is slow.
    verify: ssl.SSLContext | bool = False
    if url.startswith("https:"):
        from ico3d.chat.services.tls import client_context

        verify = client_context(trust_env=False)
    options: dict[str, Any] = {"timeout": seconds, "trust_env": False, "headers": headers}
    async with (
        asyncio.timeout(seconds),
        httpx.AsyncClient(verify=verify, **options) as http,
        http.stream("GET", url) as response,
    ):
        response.raise_for_status()
        async for part in response.aiter_raw():
            data += part
            if len(data) > MOST_BYTES:
                raise TimeoutError
    return data


def _name(entry: Any) -> str:
    name = entry.get("id") if isinstance(entry, dict) else None
    return name if isinstance(name, str) else ""
