"""A conversation that does not start, or breaks off: its page is told, its place is free."""

import asyncio
import re
import threading
import time
from dataclasses import replace

import pytest
from loguru import logger
from pipecat.frames.frames import EndWorkerFrame
from pipecat.processors.frame_processor import FrameDirection

from ico3d.chat.parts import make_parts
from ico3d.chat.services import ChosenService
from ico3d.chat.serving.server import open_avatar
from ico3d.chat.wire.protocol import VERSION as VERSION
from ico3d.chat.wire.protocol import Error, Speech, Text, Welcome
from ico3d.cli import main
from ico3d.errors import Ico3dError, MissingModelError
from ico3d.measure.talking.page import open_page
from support.chat.pages import first_message
from support.chat.serving import OFFLINE, TYPED, free_port, serving
from support.chat.waiting import until

pytestmark = pytest.mark.slow

UNREADY = "the avatar cannot talk now: something on the server does not start. Try again later."
KINDS = ("recognition", "language", "voice")


@pytest.fixture
def told():
    """What whoever runs the server is told."""
    lines = []
    number = logger.add(lambda message: lines.append(message.record["message"]), level="WARNING")
    yield lines
    logger.remove(number)


def failing(kind, error):
    """Makes an avatar one of whose services fails as long as `errors` holds one, and `errors`."""
    errors = [error]

    def adapt(avatar):
        service: ChosenService = getattr(avatar.services, kind)

        def make(options, context):
            if errors:
                raise errors[0]
            return service.provider.make(options, context)

        broken = replace(service, provider=replace(service.provider, make=make))
        return replace(avatar, services=replace(avatar.services, **{kind: broken}))

    return adapt, errors


FAULTS = [
    RuntimeError("CUDA out of memory. Tried to allocate 20 MiB\nand so on"),
    ImportError("libcudnn.so.9: cannot open shared object file"),
    MemoryError(),
    KeyError("weight"),
    AssertionError(),
    TimeoutError("of its own"),
    MissingModelError("the weights of it are not here: fetch them."),
]


@pytest.mark.parametrize("error", FAULTS, ids=lambda error: type(error).__name__)
def test_whatever_goes_wrong_is_one_sentence(bundle, error):
    for kind in KINDS:
        adapt, _ = failing(kind, error)
        avatar = adapt(open_avatar(bundle, OFFLINE))
        with pytest.raises(Ico3dError) as raised:
            make_parts(avatar)
        sentence = str(raised.value)
        assert sentence.endswith(".") and "\n" not in sentence and len(sentence) > 20
        if not isinstance(error, Ico3dError):
            assert sentence.startswith(f"{kind} with ") and type(error).__name__ in sentence


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_wrong_and_is_no_more_is_tried_again(bundle, kind):
    adapt, errors = failing(kind, RuntimeError("busy"))
    avatar = adapt(open_avatar(bundle, OFFLINE))
    with pytest.raises(Ico3dError):
        make_parts(avatar)
    errors.clear()
    assert make_parts(avatar).services.voice.stand_in


@pytest.mark.parametrize("at_home", [True, False])
async def test_the_page_of_a_conversation_that_does_not_start_may_try_again(bundle, told, at_home):
    secret = "CUDA out of memory on gpu7.internal"
    adapt, errors = failing("language", RuntimeError(secret))
    async with serving(bundle, TYPED, adapt=adapt) as (url, sessions):
        assert sessions.at_home  # as it is bound
        sessions.at_home = at_home
        for _ in range(3):
            error = await first_message(url)
            assert isinstance(error, Error) and error.fatal and error.again
            assert (secret in error.message) == at_home
            assert at_home or error.message == UNREADY
        assert len(sessions) == 0
        errors.clear()
        assert isinstance(await first_message(url), Welcome)
    assert len([line for line in told if secret in line and "start failed: " in line]) == 3


@pytest.mark.real_time  # a thread waits
async def test_a_service_that_never_starts_is_not_waited_for(bundle):
    going_on = threading.Event()

    def adapt(avatar):
        voice = avatar.services.voice

        def make(options, context):
            going_on.wait(20)
            return voice.provider.make(options, context)

        slow = replace(voice, provider=replace(voice.provider, make=make))
        return replace(avatar, services=replace(avatar.services, voice=slow))

    async with serving(bundle, TYPED, adapt=adapt) as (url, sessions):
        sessions._starting = 0.5
        began = time.monotonic()
        error = await first_message(url)
        assert isinstance(error, Error) and error.fatal and error.again
        assert "not ready within 0.5 s" in error.message
        assert time.monotonic() - began < 5 and len(sessions) == 0
        going_on.set()
        sessions._starting = 30.0
        assert isinstance(await first_message(url), Welcome)


async def cancelled(conversation):
    await conversation._worker.cancel()


async def killed(conversation):
    conversation._task.cancel()


async def declared_dead(conversation):
    await conversation._input.push_frame(EndWorkerFrame(), FrameDirection.UPSTREAM)


@pytest.mark.parametrize(
    ("end", "away"),
    [(cancelled, False), (killed, False), (declared_dead, False), (cancelled, True)],
)
async def test_a_pipeline_that_ends_takes_its_session_along(bundle, told, end, away):
    async with serving(bundle, replace(TYPED, max_sessions=1)) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        await page.wait(Speech)
        if away:
            page._socket.transport.abort()
            await asyncio.sleep(0.1)
        await end(sessions._open[welcome.session].conversation)
        if not away:
            _, error = await page.wait(Error, timeout=10)
            assert error.fatal and error.again and "broke off" in error.message
            assert await asyncio.wait_for(page.closed(), 5) == 1000
        await until(lambda: len(sessions) == 0)
        again, begun = await open_page(url, welcome.session, -1, microphone=False)
        assert not begun.resumed
        await again.wait(Speech)
        await again.close()
        await page.close()
    assert told == ["pipeline failed: it ended by itself, and the conversation with it"]


async def test_a_fault_of_ours_is_told_and_not_met_again(bundle, told, monkeypatch):
    secret = "my secret"

    async def ask(entrance, text):
        raise ZeroDivisionError(text)

    monkeypatch.setattr("ico3d.chat.listener.PageInput.ask", ask)
    async with serving(bundle, TYPED) as (url, sessions):
        page, _ = await open_page(url, microphone=False)
        await page.send(Text(secret))
        _, error = await page.wait(Error)
        assert error.fatal and error.again and "broke off" in error.message
        await asyncio.wait_for(page.closed(), 5)
        await asyncio.sleep(0.1)
        assert len(sessions) == 0
        await page.close()
    assert told == ["connection failed: ZeroDivisionError"]


async def test_what_cannot_be_sent_does_not_end_the_talk(bundle, told):
    async with serving(bundle, TYPED) as (url, sessions):
        page, welcome = await open_page(url, microphone=False)
        await page.wait(Speech)
        sessions._open[welcome.session].page.send(Error("x" * 100_000, fatal=False))
        since = len(page.log)
        await page.send(Text("who are you"))
        await page.wait(Speech, since)
        await page.close()
    assert len(told) == 1 and "x" * 20 not in told[0]


def test_serve_tells_of_a_service_that_does_not_start_before_it_opens(
    bundle_path, tmp_path, capsys
):
    settings = tmp_path / "settings.toml"
    url = f"http://127.0.0.1:{free_port()}/v1"
    settings.write_text(f'[language]\nuse = "openai"\nurl = "{url}"\n')
    assert main(["serve", str(bundle_path), "--port", "0", "--settings", str(settings)]) == 1
    told = capsys.readouterr()
    assert told.out == "" and re.fullmatch(r"ico3d: .*\n", told.err) and url in told.err
