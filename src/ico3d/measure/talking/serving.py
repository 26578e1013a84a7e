"""Starts servers to be measured, each in its own process.

`python -m ico3d.measure.talking.serving` runs a server with a script.
"""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ico3d.chat.settings.conversation import ChatSettings, Turns
from ico3d.errors import BundleError
from ico3d.measure.talking.scripted import Script

STARTING = 30  # s that a server may take
JUMPING = "ICO3D_BENCH_JUMP"
"""Variable of the environment: seconds by which the server's calendar jumps with each SIGUSR1."""


@dataclass(frozen=True)
class Watched:
    """A running server that is watched from outside.

    Attributes:
        url: Its address.
        figures: Address of its figures for Prometheus.
        process: Number of its process.
    """

    url: str
    figures: str
    process: int


@contextmanager
def serving(bundle: Path, settings: Path | None = None) -> Iterator[str]:
    """Runs `ico3d serve` on a free port during the `with` block; yields the URL.

    Raises:
        BundleError: If the server does not start.
    """
    command = ["-m", "ico3d.cli", "serve", str(bundle), "--port", "0"]
    command += ["--settings", str(settings)] if settings else []
    with _running(command) as (urls, _):
        yield urls[0]


@contextmanager
def serving_script(bundle: Path, script: Script, settings: ChatSettings) -> Iterator[str]:
    """Runs a server whose services have set delays during the `with` block; yields the URL.

    Args:
        bundle: The avatar to serve.
        script: What the services do.
        settings: Settings of turns and of the number of sessions.

    Raises:
        BundleError: If the server does not start.
    """
    with watching(bundle, script, settings) as watched:
        yield watched.url


@contextmanager
def watching(
    bundle: Path, script: Script | None, settings: ChatSettings, jump: float = 0.0
) -> Iterator[Watched]:
    """Runs such a server and tells where its figures are.

    Args:
        bundle: The avatar to serve.
        script: What the services do; None for persona notes, espeak-ng and the offline recogniser.
        settings: Settings of turns and of the number of sessions.
        jump: Seconds by which the server's calendar jumps with each SIGUSR1.

    Raises:
        BundleError: If the server does not start.
    """
    told = [script and dataclasses.asdict(script), dataclasses.asdict(settings.turns)]
    command = ["-m", __name__, str(bundle), *map(json.dumps, told), str(settings.max_sessions)]
    with _running(command, {JUMPING: str(jump)}) as (urls, process):
        yield Watched(urls[0], urls[1], process)


@contextmanager
def _running(
    arguments: list[str], variables: dict[str, str] | None = None
) -> Iterator[tuple[list[str], int]]:
    process = subprocess.Popen(
        [sys.executable, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | (variables or {}),
    )
    try:
        assert process.stdout is not None
        urls = [word for word in process.stdout.readline().split() if word.startswith("http")]
        if not urls:
            raise BundleError("the server to be measured did not start.")
        _wait_until_ready(urls[0])
        yield urls, process.pid
    finally:
        process.terminate()
        try:
            process.wait(STARTING)
        except subprocess.TimeoutExpired:
            process.kill()  # one that hangs is no reason to wait for ever


def _wait_until_ready(url: str) -> None:
    import urllib.error
    import urllib.request

    end = time.monotonic() + STARTING
    while True:
        try:
            urllib.request.urlopen(f"{url}health", timeout=5).close()
            return
        except urllib.error.URLError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)


def jump_on_signal(seconds: float) -> None:
    """From now on the calendar of this process jumps by some seconds with each SIGUSR1."""
    calendar, jumps = time.time, 0

    def jump(*_: object) -> None:
        nonlocal jumps
        jumps += 1

    time.time = lambda: calendar() + jumps * seconds
    signal.signal(signal.SIGUSR1, jump)


def main(bundle: str, script: str, turns: str, sessions: str) -> None:
    """Serves with scripted services until the process is ended; arguments are JSON or numbers."""
    jump_on_signal(float(os.environ.get(JUMPING, "0")))
    from ico3d.bundle.format import Bundle
    from ico3d.chat.observing.metrics import Monitor
    from ico3d.chat.observing.operator_log import set_up_log
    from ico3d.chat.serving import server
    from ico3d.chat.serving.sessions import Sessions
    from ico3d.chat.settings.conversation import Choice

    set_up_log(verbose=False)
    opened, told = Bundle.open(Path(bundle)), json.loads(script)
    settings = ChatSettings(
        language=Choice("persona-notes"),
        turns=Turns(**json.loads(turns)),
        max_sessions=int(sessions),
    )
    avatar = server.open_avatar(opened, settings)
    if told:
        avatar = dataclasses.replace(avatar, services=Script(**told).services())
    monitor = Monitor()
    visitors = Sessions(avatar, monitor=monitor)
    listener = server.bind("127.0.0.1", 0)
    app = server.make_app(opened, avatar, "127.0.0.1", visitors)
    print(server.address(listener), monitor.publish("127.0.0.1", 0), flush=True)
    server.make_server(app, sessions=visitors).run(sockets=[listener])


if __name__ == "__main__":
    main(*sys.argv[1:])
