"""A name server that is silent holds up nobody who asks for another name, nor the server's end."""

import asyncio
import socket
import threading
import time

import pytest

from ico3d.chat.serving.network import lookups
from ico3d.chat.serving.network.lookups import new_loop

FOUND = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", 0))]


@pytest.fixture
def asked(monkeypatch):
    """Names that were looked up; those that begin with "dead" get no answer while the test goes on,
    and of "nobody" there is none."""
    names, end = [], threading.Event()

    def look(host, port, *_):
        names.append(host)
        if host.startswith("dead"):
            end.wait(30)
        if host == "nobody":
            raise socket.gaierror(socket.EAI_NONAME, "unknown")
        return [(*FOUND[0][:4], ("127.0.0.1", port))]

    monkeypatch.setattr(lookups.socket, "getaddrinfo", look)
    yield names
    end.set()


def run(main):
    """Runs it in a loop of servers; returns its result, and the seconds that closing took."""
    with asyncio.Runner(loop_factory=new_loop) as runner:
        result = runner.run(main)
        begin = time.monotonic()
    return result, time.monotonic() - begin


async def given_up(name):
    """Asks for a name as tools do, which wait a little."""
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(asyncio.get_running_loop().getaddrinfo(name, 80), 0.02)


def test_a_silent_name_server_holds_up_no_other_name_and_no_end(asked):
    async def main():
        await asyncio.gather(*(given_up(f"dead{number % 5}") for number in range(40)))
        begin = time.monotonic()
        for host in ("alive", b"alive"):  # as anyio asks, and with it httpx
            found = await asyncio.get_running_loop().getaddrinfo(host, 80)
        return found, time.monotonic() - begin

    ((found, waited), closing) = run(main())
    assert found[0][4] == ("127.0.0.1", 80)
    assert waited < 1 and closing < 1
    assert sorted(asked) == ["alive", *(f"dead{number}" for number in range(5))]  # each once


def test_answers_are_kept_a_while_and_failures_too(asked, monkeypatch):
    monkeypatch.setattr(lookups, "KEPT", 0.05)
    monkeypatch.setattr(lookups, "FAILED", 0.05)

    async def main():
        ask = asyncio.get_running_loop().getaddrinfo
        for _ in range(2):
            for _ in range(3):
                await ask("alive", 80)
                with pytest.raises(socket.gaierror, match="unknown"):
                    await ask("nobody", 80)
            await asyncio.sleep(0.2)

    run(main())
    assert sorted(asked) == ["alive", "alive", "nobody", "nobody"]


def test_only_so_many_names_are_looked_up_at_once(asked):
    async def main():
        await asyncio.gather(*(given_up(f"dead{number}") for number in range(lookups.MOST)))
        with pytest.raises(socket.gaierror, match="too many"):
            await asyncio.get_running_loop().getaddrinfo("alive", 80)

    run(main())
    assert len(asked) == lookups.MOST


@pytest.mark.parametrize("host", ["alive", "127.0.0.1"])
def test_connections_are_made_to_what_is_found(asked, host):
    async def main():
        async def greet(_, writer):
            writer.write(b"hello")
            writer.close()

        server = await asyncio.start_server(greet, "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection(host, server.sockets[0].getsockname()[1])
        said = await reader.read()
        writer.close()
        server.close()
        with pytest.raises(OSError):
            await asyncio.open_connection(host, 1)
        return said

    assert run(main())[0] == b"hello"
    assert set(asked) == ({"alive"} if host == "alive" else set())
