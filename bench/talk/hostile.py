"""A hostile client: tries to get in, to take everything, and to wear a server out.

    ico3d serve demo --port 8765 --name talk.example --proxy 127.0.0.1 --settings hostile.toml
    python bench/talk/hostile.py http://127.0.0.1:8765/ KEY

It plays many machines by the header X-Forwarded-For, which that server believes this machine, and
prints for each attempt what came of it and whether the server withstood.
"""

import asyncio
import base64
import contextlib
import itertools
import sys
import time
from collections import Counter
from dataclasses import dataclass
from typing import Annotated
from urllib.parse import urlsplit

import httpx
import numpy as np
import tyro
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException

from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import VERSION, Answer, Audio, Error, Hello, Place, Text, Welcome
from ico3d.cli import run_script

NAME = "talk.example"
MINE, NEIGHBOUR = "203.0.113.7", "198.51.100.9"
SILENT = 400  # connections on which nothing, or next to nothing, is sent
WAIT = 20.0  # s
LARGE = "head.safetensors"
OTHER_WAYS = (
    *("x/../bundle/manifest.json", "bundle%2fmanifest.json", "/bundle/manifest.json"),
    *("BUNDLE/manifest.json", "bundle//manifest.json", "./bundle/manifest.json", "%62undle/x"),
)
FOREIGN_HOSTS = (
    *("evil.example", f"{NAME}.evil.example", f"evil.example@{NAME}", f"{NAME}:x", "192.0.2.1"),
    *(
        "",
        "localhost.evil.example",
        f"{NAME}..",
        f"{NAME}, evil.example",
        "[::1",
        "127.0.0.1.nip.io",
    ),
)
FOREIGN_ORIGINS = (
    *("null", "http://evil.example", f"http://{NAME}.evil.example", "file://", f"https://{NAME}:1"),
)
OUTSIDE = (
    *("..%2f..%2fetc%2fpasswd", "%2e%2e/%2e%2e/etc/passwd", "assets/..%5c..%5cx", "bundle/%00"),
    *("../../../etc/passwd", "assets/../../../serving/server.py", "bundle/../../settings.toml"),
)


class Target:
    """The server that is attacked."""

    def __init__(self, url: str, key: str):
        """Takes its address and the key that a visitor knows."""
        self.url, self.key = url, key
        parts = urlsplit(url)
        self.host, self.port = parts.hostname or "", parts.port or 80
        self.token = ""

    async def ask(self, line: str, machine: str = MINE, **headers: str) -> int:
        """Status of a request that is sent as it stands; 0 if there is no answer."""
        sent = {"Host": NAME, "X-Forwarded-For": machine, "Connection": "close"} | headers
        head = "".join(f"{name}: {value}\r\n" for name, value in sent.items())
        reader, writer = await self.raw()
        try:
            writer.write(f"{line} HTTP/1.1\r\n{head}\r\n".encode())
            answer = await asyncio.wait_for(reader.readline(), WAIT)
            return int(answer.split()[1])
        except (ConnectionError, TimeoutError, IndexError):
            return 0
        finally:
            writer.close()

    async def get(self, path: str, machine: str = MINE, **headers: str) -> int:
        """Status of a file."""
        return await self.ask(f"GET /{path}", machine, **headers)

    async def try_key(self, key: str, machine: str) -> int:
        """Status of a request for a token."""
        return await self.ask("POST /token", machine, Authorization=f"Bearer {key}")

    def socket(self, machine: str = MINE, token: str | None = None, **headers: str):
        """A WebSocket that is about to open."""
        sent = {"X-Forwarded-For": machine} | headers
        token = self.token if token is None else token
        address = f"ws://{self.host}:{self.port}/ws?token={token}"
        return connect(address, additional_headers=sent, max_size=None, proxy=None)

    async def raw(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A bare connection."""
        return await asyncio.open_connection(self.host, self.port)


async def first(socket) -> object:
    """What a new page is told first."""
    await socket.send(encode(Hello(VERSION, None, -1)))
    return decode_server(await asyncio.wait_for(socket.recv(), WAIT))


async def getting_in(target: Target) -> dict[str, bool]:
    """Without a key, with guessed, forged and foreign ones, and by names that are not its own."""
    guesses = Counter([await target.try_key("x" * 19, "192.0.2.1") for _ in range(40)])
    odd_keys = ["", "a" * 60_000, "a" * 100_000, "\x7f", "Ä" * 19, target.key[:-1]]
    odd = [await target.try_key(key, "192.0.2.2") for key in odd_keys]
    forged = forgeries(target.token)
    files = [await target.get(f"bundle/manifest.json?token={token}") for token in forged]
    files += [await target.get(name) for name in OTHER_WAYS]
    sockets = [await refused(target.socket(token=token)) for token in forged]
    asked = f"bundle/manifest.json?token={target.token}"
    foreign = [await target.get(asked, Host=host) for host in FOREIGN_HOSTS]
    foreign += [await target.get(asked, Origin=origin) for origin in FOREIGN_ORIGINS]
    foreign += [await refused(target.socket(Origin=origin)) for origin in FOREIGN_ORIGINS]
    outside = [await target.get(f"{path}?token={target.token}") for path in OUTSIDE]
    own = [await target.get(asked, Host=host) for host in (NAME, f"{NAME}.", "localhost")]
    print(f"  guesses {dict(guesses)}, odd keys {odd}, forged {files} {sockets}")
    print(f"  foreign {foreign}, outside {outside}, own {own}")
    return {
        "guessing is slowed down": guesses[429] >= 25 and set(guesses) <= {401, 429},
        "odd keys admit nobody": set(odd) <= {0, 400, 401},
        "forged tokens open no file": set(files) <= {400, 401, 404},
        "forged tokens open no socket": set(sockets) == {403},
        "foreign names and pages are refused": set(foreign) <= {400, 403},
        "no file outside is served": set(outside) <= {400, 404},
        "its own names are answered": set(own) == {200},
    }


def forgeries(token: str) -> list[str]:
    """Tokens that nobody has given."""
    expires, origin, signature = token.split(".")
    foreign = base64.urlsafe_b64encode(b"https://evil.example").decode().rstrip("=")
    ends = [f"{expires}.{origin}.", f"{expires}.{foreign}.{signature}", token[:-1], token + "A"]
    return ["", "0", f"{int(expires) + 10**6}.{origin}.{signature}", "9" * 3000, *ends]


async def refused(opening) -> int:
    """Status with which a handshake is refused; 101 if it is not."""
    try:
        async with opening:
            return 101
    except InvalidStatus as error:
        return error.response.status_code


async def taking_places(target: Target) -> dict[str, bool]:
    """One address opens as many talks as it can; another one comes."""
    async with contextlib.AsyncExitStack() as held:
        mine = []
        for _ in range(12):
            socket = await held.enter_async_context(target.socket())
            mine.append(await first(socket))
        kinds = Counter(type(message).__name__ for message in mine)
        other = await held.enter_async_context(target.socket(NEIGHBOUR))
        neighbour = await first(other)
    await asyncio.sleep(2)
    begun: Counter = Counter()
    for _ in range(40):
        async with target.socket("203.0.113.8") as socket:
            begun[type(await first(socket)).__name__] += 1
    print("  places", dict(kinds), type(neighbour).__name__, "begun anew", dict(begun))
    return {
        "one address gets half of the places": kinds[Welcome.__name__] == 2,
        "another one gets a place at once": isinstance(neighbour, Welcome),
        "nobody begins anew without end": begun[Welcome.__name__] + begun[Place.__name__] <= 14,
    }


async def asking(target: Target) -> dict[str, bool]:
    """Asks as fast as it can for half a minute, coming back with each refusal."""
    answers, told, until = 0, Counter(), time.monotonic() + 30
    while time.monotonic() < until:
        with contextlib.suppress(ConnectionClosed, TimeoutError):
            async with target.socket("203.0.113.20") as socket:
                await socket.send(encode(Hello(VERSION, None, -1)))
                seen: set[int] = set()
                while time.monotonic() < until:
                    await socket.send(encode(Text("Who are you?")))
                    with contextlib.suppress(TimeoutError):
                        while True:
                            message = decode_server(await asyncio.wait_for(socket.recv(), 0.3))
                            if isinstance(message, Answer):
                                answers += message.utterance not in seen
                                seen.add(message.utterance)
                            elif isinstance(message, Error):
                                told[message.code or message.message[:40]] += 1
        await asyncio.sleep(0.2)
    print("  answers in 30 s", answers, dict(told))
    return {"questions have a limit": answers <= 2 * 30 + 15 + 12}  # two places, refill, greetings


async def flooding(target: Target) -> dict[str, bool]:
    """Sound, garbage and oversized frames; the server goes on."""
    hello, ends = encode(Hello(VERSION, None, -1)), []
    second = encode(Audio(0, np.zeros(16_000, np.int16)))
    floods = {
        "sound": itertools.repeat(second, 2000),
        "garbage": itertools.repeat("[" * 60_000, 200),
        "large": [b"\0" * (1 << 22)],
        "nothing": itertools.repeat(b"", 5000),
        "nested": ['{"a":' * 20_000],
    }
    for machine, (_, flood) in enumerate(floods.items()):
        try:
            async with target.socket(f"203.0.113.{30 + machine}") as socket:
                await socket.send(hello)
                read = asyncio.create_task(reading(socket))  # else its end would not be seen
                with contextlib.suppress(ConnectionClosed):
                    for frame in flood:
                        await socket.send(frame)
                ends.append(await asyncio.wait_for(read, 30))
        except TimeoutError:
            ends.append("open")
        except (WebSocketException, OSError) as error:
            ends.append(type(error).__name__)
    print("  floods end with", dict(zip(floods, ends, strict=True)))
    return {
        "floods end their connection": "open" not in ends,
        "it goes on": await target.get("health") == 200,
    }


async def reading(socket) -> int | None:
    """Reads to the end of a connection; the code with which it was closed."""
    with contextlib.suppress(ConnectionClosed):
        while True:
            await socket.recv()
    return socket.close_code


async def being_slow(target: Target) -> dict[str, bool]:
    """Opens connections and sends nothing, headers drop by drop, or reads nothing."""
    begun = time.monotonic()
    lines = [await target.raw() for _ in range(SILENT)]
    for _, writer in lines[: SILENT // 2]:
        writer.write(b"GET /health HTTP/1.1\r\nX-A: ")
    alive = await target.get("health")
    closed = 0
    for reader, writer in lines:
        with contextlib.suppress(TimeoutError, ConnectionError):
            await asyncio.wait_for(reader.read(), max(0.1, begun + 15 - time.monotonic()))
            closed += 1
        writer.close()
    took = time.monotonic() - begun
    before = await memory(target)
    readers = []
    for number in range(100):
        _, writer = await target.raw()
        head = f"Host: {NAME}\r\nX-Forwarded-For: 203.0.113.{number}\r\n\r\n"
        name = f"/bundle/{LARGE}?token={target.token}"
        writer.write(f"GET {name} HTTP/1.1\r\n{head}".encode())
        readers.append(writer)
    await asyncio.sleep(5)
    grown = await memory(target) - before
    for writer in readers:
        writer.close()
    print(
        f"  {closed} of {SILENT} silent connections closed within {took:.1f} s; "
        f"100 slow readers took {grown:.0f} MB"
    )
    return {
        "silent connections are closed": closed == SILENT,
        "it answers meanwhile": alive == 200,
        "slow readers take little memory": grown < 200,
    }


async def memory(target: Target) -> float:
    """Resident memory of the server in MB."""
    import psutil

    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            if any(
                c.laddr.port == target.port and c.status == "LISTEN"
                for c in process.net_connections()
            ):
                return process.memory_info().rss / 1e6
    return float("nan")


@dataclass(frozen=True)
class Hostile:
    """Attacks a server; the exit status is the number of attempts that succeeded.

    Attributes:
        url: Address of the server.
        key: Its key.
    """

    url: Annotated[str, tyro.conf.Positional]
    key: Annotated[str, tyro.conf.Positional]

    def run(self) -> None:
        """Makes all attempts."""
        sys.exit(asyncio.run(self._attack()))

    async def _attack(self) -> int:
        target, lost = Target(self.url, self.key), 0
        headers = {"Authorization": f"Bearer {self.key}"}
        target.token = httpx.post(f"{self.url}token", headers=headers).json()["token"]
        for attempt in (getting_in, taking_places, asking, flooding, being_slow):
            print(f"\n{attempt.__doc__}")
            for claim, holds in (await attempt(target)).items():
                print(f"  {'holds' if holds else 'BROKEN'}: {claim}")
                lost += not holds
        return lost


if __name__ == "__main__":
    sys.exit(run_script(Hostile))
