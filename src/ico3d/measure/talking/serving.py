"""Starts servers to be measured, each in its own process.

`python -m ico3d.measure.talking.serving` runs a server with a script.
"""

import dataclasses
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ico3d.chat.settings.conversation import ChatSettings, Turns
from ico3d.errors import BundleError
from ico3d.measure.talking.scripted import Script

STARTING = 30  # s that a server may take


@contextmanager
def serving(bundle: Path, settings: Path | None = None) -> Iterator[str]:
    """Runs `ico3d serve` on a free port during the `with` block; yields the URL.

    Raises:
        BundleError: If the server does not start.
    """
    command = ["-m", "ico3d.cli", "serve", str(bundle), "--port", "0"]
    with _running([*command, *(["--settings", str(settings)] if settings else [])]) as url:
        yield url


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
    told = [json.dumps(dataclasses.asdict(options)) for options in (script, settings.turns)]
    with _running(["-m", __name__, str(bundle), *told, str(settings.max_sessions)]) as url:
        yield url


@contextmanager
def _running(arguments: list[str]) -> Iterator[str]:
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        urls = [word for word in process.stdout.readline().split() if word.startswith("http")]
        if not urls:
            raise BundleError("the server to be measured did not start.")
        _wait_until_ready(urls[0])
        yield urls[0]
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


def main(bundle: str, script: str, turns: str, sessions: str) -> None:
    """Serves with scripted services until the process is ended; arguments are JSON or numbers."""
    from ico3d.bundle.format import Bundle
    from ico3d.chat.observing.operator_log import set_up_log
    from ico3d.chat.serving import server
    from ico3d.chat.serving.sessions import Sessions

    set_up_log(verbose=False)
    opened = Bundle.open(Path(bundle))
    settings = ChatSettings(turns=Turns(**json.loads(turns)), max_sessions=int(sessions))
    avatar = server.open_avatar(opened, settings)
    avatar = dataclasses.replace(avatar, services=Script(**json.loads(script)).services())
    visitors = Sessions(avatar)
    listener = server.bind("127.0.0.1", 0)
    app = server.make_app(opened, avatar, "127.0.0.1", visitors)
    print(server.address(listener), flush=True)
    server.make_server(app, sessions=visitors).run(sockets=[listener])


if __name__ == "__main__":
    main(*sys.argv[1:])
