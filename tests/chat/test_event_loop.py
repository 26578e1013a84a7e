"""Nothing blocks the event loop while services are looked up and made, whatever they do."""

import asyncio
import contextlib
import socket
import threading
import time
from dataclasses import replace

import pytest

from ico3d.chat.services.language import local, openai
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire.protocol import Error, Heard, Speech, Text, Welcome
from ico3d.measure.talking.page import open_page
from support.chat.pages import first_message
from support.chat.serving import OFFLINE, serving

# Whether threads hold up the loop is measured against a thread that sleeps.
pytestmark = [pytest.mark.slow, pytest.mark.real_time]

LONGEST = 0.1  # s that the event loop may pause for longer than a thread that does nothing
TRIES = 3  # a busy machine pauses now and then; what blocks does so every time
BEAT = 0.005  # s


@contextlib.contextmanager
def silent_server():
    """Yields the port of a server that accepts connections and never says anything."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        accepted = []

        def accept():
            with contextlib.suppress(OSError):
                while True:
                    accepted.append(listener.accept()[0])

        thread = threading.Thread(target=accept, daemon=True)
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            listener.shutdown(socket.SHUT_RDWR)
            thread.join(5)
            for connection in accepted:
                connection.close()


class Pauses:
    """How much longer the event loop paused than a thread beside it, which nothing blocks."""

    def __init__(self):
        self.loop = self.thread = 0.0  # s of the longest
        self._over = threading.Event()

    async def __aenter__(self):
        self._task = asyncio.create_task(self._measure())
        self._beside = threading.Thread(target=self._control, daemon=True)
        self._beside.start()
        return self

    async def __aexit__(self, *_):
        self._over.set()
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)
        self._beside.join()

    @property
    def excess(self):
        return self.loop - self.thread

    async def _measure(self):
        while True:
            before = time.monotonic()
            await asyncio.sleep(BEAT)
            self.loop = max(self.loop, time.monotonic() - before - BEAT)

    def _control(self):
        while not self._over.is_set():
            before = time.monotonic()
            time.sleep(BEAT)
            self.thread = max(self.thread, time.monotonic() - before - BEAT)


async def shortest_excess(scene):
    """The least of some tries of a scene in which the loop is measured."""
    excesses = []
    while not excesses or (min(excesses) >= LONGEST and len(excesses) < TRIES):
        async with Pauses() as pauses:
            await scene()
        excesses.append(pauses.excess)
    return min(excesses)


@pytest.mark.parametrize("how", ["local", "unnamed model"])
async def test_a_model_server_that_never_answers_holds_up_nobody(bundle, monkeypatch, how):
    with silent_server() as port:
        monkeypatch.setattr(local, "PORTS", (port,))
        monkeypatch.setattr(openai, "SLOWEST", 1.0)
        monkeypatch.setattr(local, "PATIENT", 1.0)
        url = {"url": f"http://127.0.0.1:{port}/v1"}
        choice = Choice("local") if how == "local" else Choice("openai", url)
        async with serving(bundle, ChatSettings(language=choice)) as (url, sessions):

            async def visitors_come():
                began = time.monotonic()
                told = await asyncio.gather(*(first_message(url) for _ in range(4)))
                assert all(isinstance(m, Error) and m.fatal and m.again for m in told)
                assert time.monotonic() - began > 0.9  # they waited for it

            assert await shortest_excess(visitors_come) < LONGEST
            assert len(sessions) == 0


async def test_three_servers_that_never_answer_hold_up_nobody(bundle):
    with silent_server() as port:
        url = {"url": f"http://127.0.0.1:{port}/v1"}
        language = Choice("openai", {**url, "model": "any"})
        settings = ChatSettings(
            recognition=Choice("openai", url), language=language, voice=Choice("openai", url)
        )
        async with serving(bundle, settings) as (url, _):
            pages = []

            async def visitors_come():
                for _ in range(2):
                    page, _ = await open_page(url, microphone=False)
                    pages.append(page)
                    await page.send(Text("are you there?"))
                await asyncio.sleep(0.5)
                for page in pages:
                    await page.close()

            assert await shortest_excess(visitors_come) < LONGEST


SLOW = 0.4  # s that everything takes which a service is asked before it works


def slowed(service):
    """A service that takes its time at whatever it is asked before it works."""

    def wait(call):
        def waiting(*args):
            time.sleep(SLOW)
            return call(*args)

        return waiting

    provider = service.provider
    calls = {name: wait(getattr(provider, name)) for name in ("make", "hindrance", "detail")}
    return replace(service, provider=replace(provider, **calls))


def sluggish(avatar):
    chosen = avatar.services
    kinds = ("recognition", "language", "voice")
    slow = {kind: slowed(getattr(chosen, kind)) for kind in kinds}
    return replace(avatar, services=replace(chosen, **slow))


async def test_visitors_come_and_come_back_while_services_take_their_time(bundle):
    async with serving(bundle, OFFLINE, adapt=sluggish) as (url, _):
        first, welcome = await open_page(url, microphone=False)
        await first.wait(Speech)

        async def visitors_come():
            nonlocal first
            pages = await asyncio.gather(*(open_page(url, microphone=False) for _ in range(2)))
            first._socket.transport.abort()
            await first.close()
            first, resumed = await open_page(url, welcome.session, -1, microphone=False)
            assert resumed.resumed and resumed.services == welcome.services
            for page, _ in pages:
                await page.close()

        assert await shortest_excess(visitors_come) < LONGEST
        await first.close()


async def test_nothing_is_looked_up_on_the_event_loop(bundle, monkeypatch):
    """Not when a visitor comes or comes back, and not for any message of his."""
    from ico3d.chat import services

    asked = []

    def looked_up(call):
        def counted(*args):
            asked.append(threading.current_thread())
            return call(*args)

        return counted

    for kind, name in (
        (services.ChosenService, "make"),
        (services.ChosenService, "described"),
        (services.Chosen, "dictation"),
    ):
        monkeypatch.setattr(kind, name, looked_up(getattr(kind, name)))
    settings = replace(OFFLINE, recognition=Choice("browser", {"fallback": "best"}))
    async with serving(bundle, settings) as (url, _):
        asked.clear()  # what was found out before visitors came
        page, welcome = await open_page(url, microphone=False)
        assert isinstance(welcome, Welcome) and welcome.dictation
        for number in range(5):
            await page.send(Heard(number, "hello", final=True))
        await page.send_frame("garbage")
        await page.wait(Error)  # and all before it has been read
        page._socket.transport.abort()
        await page.close()
        again, _ = await open_page(url, welcome.session, -1, microphone=False)
        await again.close()
    assert asked and threading.main_thread() not in asked
