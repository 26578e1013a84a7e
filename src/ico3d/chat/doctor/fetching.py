"""Answers of a server that may be broken or hostile: read as they are, and only their beginning."""

import time
from dataclasses import dataclass
from typing import Any, cast

import httpx

from ico3d.common.typed import loose_json

PATIENCE = 10.0  # s for an answer
MOST_BYTES = 1 << 20  # of an answer that are read


@dataclass(frozen=True)
class Answer:
    """An answer, as far as it was read.

    Attributes:
        status: Its status.
        headers: Its headers.
        body: Its first bytes, which may be compressed.
    """

    status: int
    headers: httpx.Headers
    body: bytes

    @property
    def text(self) -> str:
        """The body as text; empty if it is compressed."""
        packed = "content-encoding" in self.headers
        return "" if packed else self.body.decode("utf-8", "replace")

    @property
    def table(self) -> dict[str, Any]:
        """The JSON object in the body; empty if it holds none."""
        try:
            content: object = loose_json(self.body)
        except ValueError:
            return {}
        return cast(dict[str, Any], content) if isinstance(content, dict) else {}


def client_of(url: str, verify: Any = True) -> httpx.Client:
    """A client for a server; it is patient for a while.

    It asks the server itself. A proxy that the environment names could read what is unencrypted,
    keys included, and what it answers says nothing of the server.
    """
    return httpx.Client(base_url=url, verify=verify, timeout=PATIENCE, trust_env=False)


def fetch(client: httpx.Client, path: str, method: str = "GET", **request: Any) -> Answer:
    """Asks a server.

    Raises:
        HTTPError: If there is no answer.
    """
    body, end = bytearray(), time.monotonic() + PATIENCE
    with client.stream(method, path, **request) as answer:
        for piece in answer.iter_raw():
            body += piece
            if len(body) > MOST_BYTES or time.monotonic() > end:
                break
        return Answer(answer.status_code, answer.headers, bytes(body[:MOST_BYTES]))
