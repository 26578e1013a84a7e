"""systemd hears that a server is ready and lives, as long as it does."""

import asyncio
import contextlib
import socket
import time

import pytest

from ico3d.chat.serving.running.alive import told_alive


@pytest.fixture
def heard(tmp_path, monkeypatch):
    """What was told since the last call, where somebody wants to hear within 0.2 s."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
        line.bind(str(tmp_path / "notify"))
        line.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "200000")

        def listen():
            words = []
            with contextlib.suppress(BlockingIOError):
                while True:
                    words.append(line.recv(100).decode())
            return words

        yield listen


async def test_a_server_says_that_it_lives_until_it_stands_still(heard):
    async with told_alive():
        assert heard() == ["READY=1"]
        await asyncio.sleep(0.35)
        said = heard()
        assert len(said) > 1 and set(said) == {"WATCHDOG=1"}
        time.sleep(0.35)  # the loop stands still
        assert heard() == []
    assert heard() == ["STOPPING=1"]
    await asyncio.sleep(0.3)
    assert heard() == []


async def test_an_abstract_place_and_no_watchdog(monkeypatch):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
        line.bind("\0ico3d-test-alive")
        monkeypatch.setenv("NOTIFY_SOCKET", "@ico3d-test-alive")
        monkeypatch.delenv("WATCHDOG_USEC", raising=False)
        async with told_alive():
            await asyncio.sleep(0.1)
        assert [line.recv(100) for _ in range(2)] == [b"READY=1", b"STOPPING=1"]


async def test_nobody_listens(monkeypatch):
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    async with told_alive():
        pass
    monkeypatch.setenv("NOTIFY_SOCKET", "/nowhere")
    async with told_alive():
        pass
