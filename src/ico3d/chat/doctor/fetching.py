"""Answers of a server that may be broken or hostile: read as they are, and only their beginning."""

import asyncio
import contextlib
from dataclasses import dataclass, field
from typing import Any, cast

import httpx

from ico3d.common.typed import loose_json

PATIENCE = 10.0  # s for an answer as a whole
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


@dataclass(frozen=True)
class Client:
    """A client of a server, which keeps cookies, by which a proxy knows a visitor.

    Attributes:
        url: The server's address.
        verify: Which certificates are believed, as httpx takes it.
        cookies: What the server has set.
    """

    url: str
    verify: Any = True
    cookies: httpx.Cookies = field(default_factory=httpx.Cookies)

    def cookies_for(self, path: str) -> str:
        """The header Cookie of a request; empty where there are no cookies for the path."""
        request = httpx.Request("GET", f"{self.url}{path}")
        self.cookies.set_cookie_header(request)
        return request.headers.get("Cookie", "")


def fetch(client: Client, path: str, method: str = "GET", **request: Any) -> Answer:
    """Asks a server, which is waited for `PATIENCE` seconds, however its answer drips.

    It asks the server itself. A proxy that the environment names could read what is unencrypted,
    keys included, and what it answers says nothing of the server.

    Raises:
        HTTPError: If there is no answer, or its head does not come in time.
    """
    return asyncio.run(_fetched(client, path, method, request))


async def _fetched(client: Client, path: str, method: str, request: dict[str, Any]) -> Answer:
    body = bytearray()
    async with httpx.AsyncClient(
        base_url=client.url,
        verify=client.verify,
        timeout=PATIENCE,
        trust_env=False,
        cookies=client.cookies.jar,
    ) as http:
        sent = http.build_request(method, path, **request)
        end = asyncio.get_running_loop().time() + PATIENCE
        try:
            async with asyncio.timeout_at(end):
                answer = await http.send(sent, stream=True)
        except TimeoutError as error:
            raise httpx.ReadTimeout(f"no head of an answer in {PATIENCE:g} s") from error
        except (httpx.InvalidURL, ValueError) as error:  # httpx reads where a redirect leads
            raise httpx.RemoteProtocolError("it leads to no address") from error
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout_at(end):
                async for piece in answer.aiter_raw():
                    body += piece
                    if len(body) > MOST_BYTES:
                        break
        await answer.aclose()
        for cookie in list(client.cookies.jar):
            if not f"{cookie.name}{cookie.value}".isascii():  # which no header could hold
                client.cookies.jar.clear(cookie.domain, cookie.path, cookie.name)
        return Answer(answer.status_code, answer.headers, bytes(body[:MOST_BYTES]))
