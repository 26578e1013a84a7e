"""Calls of users' tools over HTTP, restricted to protect the server's network.

Only listed hosts are called, at addresses that are public or listed themselves; redirects must stay
on the same host, and so do headers; time and size are limited.
"""

import asyncio
import contextlib
import ipaddress
import json
import socket
from collections.abc import Mapping
from functools import partial
from itertools import accumulate
from typing import Any
from urllib.parse import SplitResult, quote, urljoin, urlsplit

import aiohttp
from aiohttp.abc import AbstractResolver, ResolveResult
from aiohttp.client_proto import ResponseHandler
from aiohttp.resolver import DefaultResolver
from pipecat.adapters.llm.schemas.function_schema import FunctionSchema
from pipecat.services.llm_service import FunctionCallParams

from ico3d.chat.services.tls import system_context
from ico3d.chat.settings.headers import blanked, filled_in
from ico3d.chat.settings.tools import PORTS, Tool, host_of
from ico3d.chat.wire.characters import sendable_json
from ico3d.common.typed import loose_json
from ico3d.errors import SettingsError

MOST_BYTES = 16 * 1024  # of an answer: the model has to read it
TOO_LONG = f"its answer has more than {MOST_BYTES} bytes"
MOST_DEPTH = 100  # of arguments and answers: the interpreter's own limit changes as it runs
MOST_RECEIVED = 4 * MOST_BYTES  # of a connection: heads of answers, which may be many, count, too
MOST_REDIRECTS = 3
REDIRECTS = (301, 302, 303, 307, 308)
GLOBAL, NAT64 = ipaddress.ip_network("2000::/3"), ipaddress.ip_network("64:ff9b::/96")
"""IPv6 addresses of the internet, and those of IPv4 hosts in networks that have IPv6 alone."""


class Refused(OSError):
    """A call that was refused."""


class CheckedResolver(AbstractResolver):
    """A DNS resolver that refuses addresses of private networks."""

    def __init__(self, allow: tuple[str, ...]):
        """Addresses listed in `allow` are accepted even if private."""
        self._allow = allow
        self._resolver = DefaultResolver()

    async def resolve(
        self, host: str, port: int = 0, family: socket.AddressFamily = socket.AF_INET
    ) -> list[ResolveResult]:
        """The addresses of a host, all of which must be permitted."""
        found = await self._resolver.resolve(host, port, family)
        for entry in found:
            check_address(entry["host"], host, port, self._allow)
        return found

    async def close(self) -> None:
        """Closes the underlying resolver."""
        await self._resolver.close()


class BoundedConnector(aiohttp.TCPConnector):
    """Connections of which no more than `MOST_RECEIVED` bytes are parsed."""

    def __init__(self, resolver: AbstractResolver):
        """Asks `resolver` for addresses."""
        super().__init__(resolver=resolver, ssl=system_context())
        self._factory = partial(_BoundedAnswers, loop=self._loop)


class _BoundedAnswers(ResponseHandler):
    """One connection; `100 Continue` and the like may come before an answer without an end."""

    def __init__(self, loop: asyncio.AbstractEventLoop):
        super().__init__(loop)
        self._room = MOST_RECEIVED

    def data_received(self, data: bytes) -> None:
        """Parses bytes, unless they are too many."""
        self._room -= len(data)
        if self._room >= 0:
            super().data_received(data)
        elif self.transport is not None:
            self.set_exception(Refused(TOO_LONG))
            self.transport.close()


def check_address(address: str, host: str, port: int, allow: tuple[str, ...]) -> None:
    """Refuses addresses of this machine and of private networks unless they are listed.

    Args:
        address: Address that would be called.
        host: Name that resolved to the address; `localhost` stands for its addresses.
        port: Port of the call.
        allow: Listed hosts, with the port unless it is the default one.

    Raises:
        Refused: If the address may not be called.
    """
    ip = ipaddress.ip_address(address.partition("%")[0])
    if isinstance(ip, ipaddress.IPv6Address):
        ip = _inside(ip)
    if ip.is_global and not ip.is_multicast and (ip.version == 4 or ip in GLOBAL):
        return
    shown = f"[{ip}]" if ip.version == 6 else str(ip)
    names = [shown, "localhost"] if ip.is_loopback and host == "localhost" else [shown]
    ends = ["", f":{port}"] if port in PORTS.values() else [f":{port}"]
    if not any(name + end in allow for name in names for end in ends):
        raise Refused(f"{host} is at the private address {ip}, which is not in 'allow'")


def _inside(ip: ipaddress.IPv6Address) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """The IPv4 address to which packets for an IPv6 address go; itself for any other."""
    if ip in NAT64:
        return ipaddress.IPv4Address(int(ip) & 0xFFFFFFFF)
    return ip.ipv4_mapped or ip.sixtofour or ip


def http_function(tool: Tool, allow: tuple[str, ...]) -> FunctionSchema:
    """A user's tool as a function for the language model."""

    async def call(params: FunctionCallParams) -> None:
        await params.result_callback(await answer(tool, params.arguments, allow))

    return FunctionSchema(tool.name, tool.description, tool.properties, tool.required, call)


async def answer(
    tool: Tool, arguments: Mapping[str, Any], allow: tuple[str, ...]
) -> dict[str, Any]:
    """Calls a tool: returns `status` and `body`, or `error` in one sentence for the model."""
    try:
        return await _fetch(tool, _request(tool, arguments), allow)
    except TimeoutError:
        return {"error": f"{tool.name} did not answer within {tool.seconds:g} seconds."}
    except aiohttp.ClientConnectorError as error:
        return {"error": f"{tool.name} cannot be reached: {error.os_error}."}
    except (Refused, SettingsError, aiohttp.ClientError, ValueError) as error:
        said = str(error).rstrip(".") or type(error).__name__
        return {"error": f"{tool.name} failed: {said}."}


def _request(tool: Tool, arguments: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """URL and further options of the request."""
    unknown = [name for name in arguments if name not in tool.properties]
    missing = [name for name in tool.required if name not in arguments]
    if unknown or missing:
        raise Refused(f"it takes {list(tool.properties)} and needs {tool.required}")
    if _levels(arguments) > MOST_DEPTH:
        raise Refused("its arguments are nested too deep")
    headers = {"headers": filled_in(tool.headers, tool.where)}
    inside = {name: _quoted(arguments[name]) for name in tool.placeholders}
    url = tool.url.format_map(inside)
    rest = {name: value for name, value in arguments.items() if name not in inside}
    if tool.method == "POST":
        return url, {"json": rest, **headers}
    return url, {"params": {name: _text(value) for name, value in rest.items()}, **headers}


def _levels(value: Any) -> int:
    """How deep lists and objects are nested in a value of JSON; counted up to one too many."""
    inside, levels = [value], 0
    while levels <= MOST_DEPTH and (inside := [v for v in inside if isinstance(v, (list, dict))]):
        levels += 1
        inside = [x for v in inside for x in (v.values() if isinstance(v, dict) else v)]
    return levels


def _quoted(value: Any) -> str:
    text = _text(value)
    if text.strip(".") == "":
        raise Refused("a part of its address would be empty or lead elsewhere")
    return quote(text, safe="")


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


async def _fetch(
    tool: Tool, request: tuple[str, dict[str, Any]], allow: tuple[str, ...]
) -> dict[str, Any]:
    url, options = request
    home = urlsplit(tool.url)
    connector = BoundedConnector(CheckedResolver(allow))
    limit = aiohttp.ClientTimeout(total=tool.seconds)
    cookies = aiohttp.DummyCookieJar()
    async with aiohttp.ClientSession(
        connector=connector, timeout=limit, cookie_jar=cookies
    ) as session:
        for _ in range(MOST_REDIRECTS + 1):
            _check(urlsplit(url), home, allow)
            async with session.request(
                tool.method, url, allow_redirects=False, **options
            ) as response:
                if response.status not in REDIRECTS:
                    return {"status": response.status, "body": await _body(tool, response)}
                url, options = _next(tool, response), {"headers": options["headers"]}
    raise Refused("it redirects too often")


def _check(url: SplitResult, home: SplitResult, allow: tuple[str, ...]) -> None:
    """It is the tool's host; an address in place of a name is never looked up, so checked here."""
    if host_of(url) != host_of(home) or url.scheme not in (home.scheme, "https"):
        raise Refused(f"it leads elsewhere, to {url.scheme}://{host_of(url)}")
    host = url.hostname or ""
    with contextlib.suppress(ValueError):
        check_address(str(ipaddress.ip_address(host)), host, url.port or PORTS[url.scheme], allow)


def _next(tool: Tool, response: aiohttp.ClientResponse) -> str:
    if tool.method != "GET":
        raise Refused("it redirects what is sent to it")
    return urljoin(str(response.url), response.headers.get("Location", ""))


async def _body(tool: Tool, response: aiohttp.ClientResponse) -> Any:
    data = b""
    async for part in response.content.iter_chunked(MOST_BYTES):
        data += part
        if len(data) > MOST_BYTES:
            raise Refused(TOO_LONG)
    text = blanked(data.decode("utf-8", "replace"), tool.headers, tool.where)
    if _depth(text) > MOST_DEPTH:
        return text
    try:
        return sendable_json(loose_json(text))
    except ValueError:
        return text


def _depth(text: str) -> int:
    """How deep the brackets of a text are nested, those in quotes among them."""
    steps = ((c in "[{") - (c in "]}") for c in text)
    return max(accumulate(steps), default=0)
