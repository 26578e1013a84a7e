"""Visitors of several servers behind a real Caddy with `deploy/Caddyfile`.

Each visitor must stay at one server, hear one tone that nobody else hears, and go on after a lost
connection without missing a sample. Then one server is asked to end amid its answers: its visitors
must hear them to the end, be told, and be received by another one; the others must notice nothing.

    python bench/talk/replicas.py --caddy caddy --json runs/replicas.json
"""

import asyncio
import contextlib
import dataclasses
import json
import os
import signal
import ssl
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import numpy as np
from rich import print as show
from websockets.asyncio.client import connect

from ico3d.chat.settings.conversation import Turns
from ico3d.chat.wire import protocol
from ico3d.chat.wire.protocol import End, Error, Hello, Speech, State, Text, Welcome
from ico3d.chat.wire.sentences import ENDING
from ico3d.cli import run_script
from ico3d.common.files import write_atomic
from ico3d.measure.talking.crowd import APART, SCRIPT, ahead, tones
from ico3d.measure.talking.page import SimulatedPage

CADDYFILE = Path(__file__).parents[2] / "deploy" / "Caddyfile"
LONG = 60.0  # s for whatever one waits for
AMID = 8.0  # s in which all ask before a server is to end: shorter than an answer


@dataclass(frozen=True)
class Replicas:
    """The bench.

    Attributes:
        bundle: The avatar to serve.
        visitors: How many talk.
        servers: How many servers share them.
        within: Seconds in which all have asked.
        caddy: The program.
        json: File for the figures.
    """

    bundle: Path = Path("demo")
    visitors: int = 40
    servers: int = 2
    within: float = 20.0
    caddy: str = "caddy"
    json: Path | None = None

    def run(self) -> None:
        """Prints the figures and writes the file."""
        with contextlib.ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            processes = [stack.enter_context(self._server(n)) for n in range(self.servers)]
            urls = [_url_of(process) for process in processes]
            url, context = stack.enter_context(proxy(self.caddy, urls, folder))
            figures = asyncio.run(self._figures(url, context, processes[0]))
        show(figures)
        if self.json is not None:
            write_atomic(self.json, json.dumps(figures, indent=1).encode())

    def _server(self, number: int) -> contextlib.AbstractContextManager[subprocess.Popen]:
        """A server whose visitors have tones that no other server's have."""
        pitch = SCRIPT.pitch + 4 * number * self.visitors * APART  # each comes up to four times
        script = dataclasses.replace(SCRIPT, pitch=pitch)
        told = [json.dumps(dataclasses.asdict(options)) for options in (script, Turns())]
        words = ["-m", "ico3d.measure.talking.serving", str(self.bundle), *told]
        return running([sys.executable, *words, str(self.visitors)])

    async def _figures(
        self, url: str, context: ssl.SSLContext, first: subprocess.Popen
    ) -> dict[str, object]:
        visitors = [Visitor(url, context) for _ in range(self.visitors)]
        await asyncio.gather(*(visitor.enter() for visitor in visitors))
        delays = np.linspace(0, self.within, self.visitors)
        both = list(zip(visitors, delays, strict=True))
        await asyncio.gather(*(visitor.ask(1, delay) for visitor, delay in both))
        early = [value for visitor in visitors for value in ahead(visitor.page)]
        own = own_tones(visitors)
        whole = await asyncio.gather(*(visitor.drop_amid(2, delay) for visitor, delay in both))
        at = Counter(visitor.cookie for visitor in visitors)
        ended = await self._end_one(visitors, first)
        return {
            "visitors_of_each_server": sorted(at.values()),
            "heard_their_own_tone_only": own,
            "pieces_of_speech": len(early),
            "ahead_ms": {"least": min(early), "p50": float(np.median(early))},
            "went_on_after_a_lost_connection_and_missed_nothing": sum(whole),
            **ended,
        }

    async def _end_one(
        self, visitors: list["Visitor"], first: subprocess.Popen
    ) -> dict[str, object]:
        """Asks one server to end while all of them listen to an answer."""
        delays = np.linspace(0, AMID, self.visitors)
        both = zip(visitors, delays, strict=True)
        await asyncio.gather(*(visitor.begin(3, delay) for visitor, delay in both))
        began = time.monotonic()
        first.send_signal(signal.SIGTERM)
        heard = await asyncio.gather(*(visitor.hears(3) for visitor in visitors))
        code = await asyncio.to_thread(first.wait, LONG)
        took = time.monotonic() - began
        told = [visitor for visitor in visitors if visitor.was_told]
        whole = [visitor for visitor, all_of_it in zip(visitors, heard, strict=True) if all_of_it]
        before = {visitor.cookie for visitor in told}
        there = sum(visitor.cookie in before for visitor in visitors)
        await asyncio.gather(*(visitor.enter() for visitor in told))
        found = {visitor.cookie for visitor in told}
        await asyncio.gather(*(visitor.leave() for visitor in visitors))
        return {
            "server_that_ended": {
                "exit_status": code,
                "seconds": round(took, 1),
                "visitors": there,
                "heard_the_answer": sum(visitor in told for visitor in whole),
                "were_told": len(told),
                "received_by_another_server": len(told) if before.isdisjoint(found) else 0,
            },
            "visitors_of_others": len(visitors) - there,
            "of_them_heard_the_answer": sum(visitor not in told for visitor in whole),
        }


class Visitor:
    """One who comes through the proxy, with the cookie that it gave."""

    def __init__(self, url: str, context: ssl.SSLContext):
        """Knows the address and whose certificates to believe."""
        self._url, self._context = url, context
        self.cookie = ""
        self._session: str | None = None
        self.page: SimulatedPage

    @property
    def was_told(self) -> bool:
        """Whether the server has said that it ends."""
        return any(error.code == ENDING.code for error in self.page.messages(Error))

    async def enter(self, last_index: int = -1) -> bool:
        """Opens a session, or resumes the one of before; whether that was resumed."""
        headers = {"Cookie": self.cookie} if self.cookie else {}
        self._socket = await connect(
            self._url.replace("http", "ws", 1) + "/ws",
            ssl=self._context,
            additional_headers=headers,
            max_size=protocol.MAX_BINARY_FRAME,
            open_timeout=LONG,
        )
        assert self._socket.response is not None
        given = self._socket.response.headers.get("Set-Cookie", "")
        self.cookie = given.partition(";")[0] or self.cookie
        self.page = SimulatedPage(self._socket, microphone=False)
        await self.page.send(Hello(protocol.VERSION, self._session, last_index))
        _, welcome = await self.page.wait(Welcome, timeout=LONG)
        self._session = welcome.session
        return welcome.resumed

    async def ask(self, utterance: int, delay: float) -> None:
        """Asks, and listens to the answer."""
        await self.begin(utterance, delay)
        await self.heard(utterance)

    async def begin(self, utterance: int, delay: float) -> None:
        """Asks, and listens to the answer's first piece."""
        await asyncio.sleep(delay)
        if utterance == 1:
            await self.page.wait(Speech, timeout=LONG)  # the greeting is cut short
        await self.page.send(Text("What shall I ask?"))
        await self.page.wait(Speech, timeout=LONG, where=lambda m: m.utterance == utterance)

    async def heard(self, utterance: int) -> None:
        """Listens to the answer's end."""
        await self.page.wait(End, timeout=LONG, where=lambda m: m.utterance == utterance)
        await self.page.heard(utterance)
        await self.page.wait(State, timeout=LONG, where=lambda m: m.state == "idle")
        await asyncio.sleep(2.0)  # the time in which a server that ends says so

    async def hears(self, utterance: int) -> bool:
        """Listens to the answer's end or the server's; whether it was the answer's."""
        told = asyncio.create_task(self.page.wait(Error, timeout=LONG))
        heard = asyncio.create_task(self.heard(utterance))
        await asyncio.wait({told, heard}, return_when=asyncio.FIRST_COMPLETED)
        for task in (told, heard):
            task.cancel()
        await asyncio.gather(told, heard, return_exceptions=True)
        return self.page.has_heard(utterance)

    async def drop_amid(self, utterance: int, delay: float) -> bool:
        """Asks, loses the connection amid the answer, comes back; whether nothing was missed."""
        await self.begin(utterance, delay)
        self._socket.transport.abort()
        before = self.page
        await before.close()
        resumed = await self.enter(before.messages(Speech)[-1].index)
        await self.heard(utterance)
        pieces = [*before.messages(Speech), *self.page.messages(Speech)]
        indices = [piece.index for piece in pieces if piece.utterance == utterance]
        return resumed and indices == list(range(indices[0], indices[0] + len(indices)))

    async def leave(self) -> None:
        """Closes the page."""
        await self.page.close()


def own_tones(visitors: list[Visitor]) -> int:
    """How many heard one tone, and nobody else the same."""
    heard = [set(tones(visitor.page)) for visitor in visitors]
    return sum(len(own) == 1 and sum(own == other for other in heard) == 1 for own in heard)


@contextlib.contextmanager
def running(command: list[str], **variables: str) -> Iterator[subprocess.Popen]:
    """A process during the `with` block."""
    environment = {**os.environ, **variables}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


@contextlib.contextmanager
def proxy(caddy: str, urls: list[str], folder: Path) -> Iterator[tuple[str, ssl.SSLContext]]:
    """Caddy with the file of `deploy/` on free ports of loopback, and trust in its certificates."""
    plain, secure = free_port(), free_port()
    ours = f"default_bind 127.0.0.1\nhttp_port {plain}\nhttps_port {secure}\nskip_install_trust\n"
    file = folder / "Caddyfile"
    file.write_text(f"{{\n{ours}admin off\nlog {{\nlevel ERROR\n}}\n}}\n{CADDYFILE.read_text()}")
    upstreams = " ".join(url.removeprefix("http://").rstrip("/") for url in urls)
    names = {"ICO3D_NAME": "localhost", "ICO3D_UPSTREAMS": upstreams, "XDG_DATA_HOME": str(folder)}
    words = [caddy, "run", "--config", str(file), "--adapter", "caddyfile"]
    with running(words, **names):
        root = folder / "caddy" / "pki" / "authorities" / "local" / "root.crt"
        url = f"https://localhost:{secure}"
        yield url, until_ready(url, root)


def until_ready(url: str, root: Path) -> ssl.SSLContext:
    """Waits for an answer through the proxy; trust in its own authority."""
    end = time.monotonic() + LONG
    while True:
        try:
            context = ssl.create_default_context(cafile=str(root))
            httpx.get(f"{url}/ready", verify=context, timeout=LONG).raise_for_status()
            return context
        except (OSError, httpx.HTTPError):
            if time.monotonic() > end:
                raise
            time.sleep(0.1)


def free_port() -> int:
    """A port that nobody listens on."""
    from ico3d.chat.serving.server import bind

    with bind("127.0.0.1", 0) as listener:
        return listener.getsockname()[1]


def _url_of(process: subprocess.Popen) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


if __name__ == "__main__":
    run_script(Replicas)
