"""The remote face is the local one, and goes on as the local one when its server fails."""

import asyncio
import contextlib
import itertools
import json
import socket
import threading
import time

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.server import ServerProtocol

from ico3d.bundle.format import SPEECH
from ico3d.chat.performing.remote_mouth import AVOIDED, FAILURES, RemoteMouth
from ico3d.chat.remote import expression
from ico3d.chat.remote.limits import Limits
from ico3d.chat.settings.conversation import ChatSettings, Expression
from ico3d.chat.wire.protocol import End, Speech, Text
from ico3d.measure.talking.page import open_page
from ico3d.speech.runtime import SpeechModel, StreamingExpressions
from support.chat.remote import expression_app, serving
from support.chat.serving import serving as serving_avatar

RATE = 24_000
LONG, SHORT = 5.0, 0.3  # s to wait for a server that answers, and for one that does not


@pytest.fixture(scope="module")
def model(bundle):
    return SpeechModel(bundle.read(SPEECH))


@pytest.fixture(scope="module")
def sha256(bundle):
    return bundle.manifest.files[SPEECH].sha256


@pytest.fixture(scope="module")
def sound():
    """2.5 s of int16 at 24 kHz, in pieces of all sizes."""
    rng = np.random.default_rng(0)
    pcm = np.clip(rng.normal(0, 5000, 60_000), -32768, 32767).astype(np.int16)
    return np.split(pcm, [700, 8000, 8001, 22_400, 30_000, 44_000])


def floats(pcm):
    return pcm.astype(np.float32) / 32768


def local(model, sound):
    stream = StreamingExpressions(model, RATE)
    return np.concatenate([*(stream.push(floats(piece)) for piece in sound), stream.finish()])


def mouth(url, model, sha256, timeout=LONG, **more):
    return RemoteMouth(Expression("remote", url, timeout=timeout), model, sha256, **more)


def remote(made, sound, between=None):
    """Rows of a sound; `between` is called before its fourth piece."""
    lips, rows = made.lips(), []
    for index, piece in enumerate(sound):
        if index == 3 and between:
            between()
        rows.append(lips.push(floats(piece)))
    return np.concatenate([*rows, lips.finish()]), lips


def test_a_name_server_that_is_silent_is_not_waited_for(model, sha256, sound, monkeypatch):
    end = threading.Event()
    monkeypatch.setattr(socket, "create_connection", lambda *_: end.wait(20))
    made = mouth("http://module.example", model, sha256, SHORT)
    begun = time.monotonic()
    rows, lips = remote(made, sound)
    made.close()
    assert time.monotonic() - begun < 3 and lips._own is not None
    np.testing.assert_allclose(rows, local(model, sound), atol=1e-5)
    end.set()


async def test_the_remote_face_is_the_local_one(bundle, model, sha256, sound):
    async with serving(expression_app(bundle)) as url:
        made = mouth(url, model, sha256)
        for said in (sound, sound[::-1]):  # sentences follow each other on one connection
            rows, lips = await asyncio.to_thread(remote, made, said)
            assert lips._own is None
            np.testing.assert_allclose(rows, local(model, said), atol=1e-5)
        made.close()


async def test_a_server_that_dies_in_mid_sentence_leaves_no_jump(bundle, model, sha256, sound):
    async with serving(expression_app(bundle)) as url:
        made = mouth(url, model, sha256)
        rows, lips = await asyncio.to_thread(
            remote, made, sound, lambda: made._socket.socket.shutdown(2)
        )
    assert lips._own is not None
    np.testing.assert_allclose(rows, local(model, sound), atol=1e-5)


async def test_a_server_that_failed_is_left_alone_for_a_while(bundle, model, sha256, sound):
    now = 0.0
    made = mouth("http://127.0.0.1:9", model, sha256, now=lambda: now)
    rows, lips = await asyncio.to_thread(remote, made, sound)
    assert lips._own is not None
    np.testing.assert_allclose(rows, local(model, sound), atol=1e-5)
    async with serving(expression_app(bundle)) as url:
        object.__setattr__(made._settings, "url", url)
        _, lips = await asyncio.to_thread(remote, made, sound)
        assert lips._own is not None
        now = AVOIDED
        rows, lips = await asyncio.to_thread(remote, made, sound)
        assert lips._own is None
        np.testing.assert_allclose(rows, local(model, sound), atol=1e-5)
        made.close()


async def test_a_server_that_is_slower_than_speech_is_left(bundle, model, sha256, sound):
    """Each answer comes within its time; all together they are too late."""
    async with serving(expression_app(bundle)) as url:
        for each, left in ((0.4, True), (0.01, False)):  # s from one look at the clock to the next
            clock = itertools.count(0.0, each)
            made = mouth(url, model, sha256, now=lambda clock=clock: next(clock))
            rows, lips = await asyncio.to_thread(remote, made, sound)
            assert (lips._own is not None) == left
            np.testing.assert_allclose(rows, local(model, sound), atol=1e-5)
            made.close()


async def test_an_interrupted_sentence_does_not_disturb_the_next(bundle, model, sha256, sound):
    async with serving(expression_app(bundle)) as url:
        made = mouth(url, model, sha256)
        old = made.lips()
        await asyncio.to_thread(old.push, floats(sound[3]))
        new = made.lips()
        rows = [await asyncio.to_thread(new.push, floats(piece)) for piece in sound[:4]]
        assert len(await asyncio.to_thread(old.push, floats(sound[4]))) == 0
        rows += [await asyncio.to_thread(new.push, floats(piece)) for piece in sound[4:]]
        rows.append(await asyncio.to_thread(new.finish))
        np.testing.assert_allclose(np.concatenate(rows), local(model, sound), atol=1e-5)
        made.close()


class Odd:
    """A WebSocket server of something else."""

    def __init__(self, hello, answer):
        self.hello, self.answer, self.left = hello, answer, asyncio.Event()

    async def __call__(self, scope, receive, send):
        if scope["type"] != "websocket":
            return
        await send({"type": "websocket.accept"})
        await send({"type": "websocket.send", "text": self.hello})
        while (await receive())["type"] != "websocket.disconnect":
            if self.answer is not None:
                await send({"type": "websocket.send", "bytes": self.answer})
        self.left.set()


NAN = np.full((1, 32), np.nan, np.float32).tobytes()


ROWS = np.zeros((1000, 32), np.float32).tobytes()


@pytest.mark.parametrize("answer", [None, b"x", NAN, b"x" * 128 * 3 + b"y", ROWS, b""])
@pytest.mark.parametrize("knows", [True, False])
async def test_any_nonsense_is_answered_by_the_own_model(model, sha256, sound, knows, answer):
    own = {"model": sha256 if knows else "0" * 64, "rate": RATE, "fps": 25, "size": 32}
    async with serving(Odd(json.dumps(own), answer)) as url:
        made = mouth(url, model, sha256, SHORT if answer is None else LONG)
        rows, lips = await asyncio.to_thread(remote, made, sound)
    assert lips._own is not None
    np.testing.assert_allclose(rows, local(model, sound), atol=1e-5)


def test_a_new_sentence_does_not_wait_for_the_answer_to_another(model, sha256):
    with socket.create_server(("127.0.0.1", 0)) as silent:
        made = mouth(f"http://127.0.0.1:{silent.getsockname()[1]}", model, sha256)
        asking = threading.Thread(target=made.lips().push, args=(np.ones(960),), daemon=True)
        asking.start()
        wire = silent.accept()[0]
        wire.recv(1)
        begun = threading.Thread(target=made.lips, daemon=True)
        begun.start()
        begun.join(LONG / 2)
        assert asking.is_alive() and not begun.is_alive()
        wire.close()


def greeted(listener, sha256):
    """The far end of the next line, once it was greeted, and its protocol."""
    own = {"model": sha256, "rate": RATE, "fps": 25, "size": 32}
    wire, protocol = listener.accept()[0], ServerProtocol()
    protocol.receive_data(wire.recv(1 << 16))
    protocol.send_response(protocol.accept(protocol.events_received()[0]))
    protocol.send_text(json.dumps(own).encode())
    wire.sendall(b"".join(protocol.data_to_send()))
    return wire, protocol


def asked(made, message):
    """A thread that asks for rows, and what it is told instead."""
    said = []

    def ask():
        try:
            made.ask(0, message, False, range(9))
        except FAILURES as error:
            said.append(error)

    asking = threading.Thread(target=ask, daemon=True)
    asking.start()
    return asking, said


def test_a_server_that_does_not_read_is_not_waited_for(model, sha256):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        made = mouth(f"http://127.0.0.1:{listener.getsockname()[1]}", model, sha256, SHORT)
        asking, said = asked(made, bytes(64 << 20))
        wire, _ = greeted(listener, sha256)
        asking.join(LONG)
        assert not asking.is_alive() and len(said) == 1
        wire.close()


def test_a_server_that_only_pings_leaves_nothing_behind(model, sha256):
    """An answer to a ping was stuck, which closing waited for: two threads were left each time."""
    before = set(threading.enumerate())
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        made = mouth(f"http://127.0.0.1:{listener.getsockname()[1]}", model, sha256, SHORT)
        asking, said = asked(made, b"")
        wire, protocol = greeted(listener, sha256)
        wire.settimeout(LONG)
        protocol.send_ping(bytes(125))
        pings = b"".join(protocol.data_to_send()) * 1000
        with pytest.raises(OSError):  # it was cut; till then it takes all
            while True:
                wire.sendall(pings)
        asking.join(LONG)
        for thread in set(threading.enumerate()) - before:
            thread.join(LONG)
        assert len(said) == 1 and set(threading.enumerate()) <= before
        wire.close()


async def test_a_server_with_an_odd_greeting_is_left(model, sha256, sound):
    odd = Odd("Hello.", None)
    async with serving(odd) as url:
        await asyncio.to_thread(remote, mouth(url, model, sha256), sound)
        await asyncio.wait_for(odd.left.wait(), LONG)


async def test_a_greeting_nested_deep_is_nonsense_too(model, sha256, sound):
    async with serving(Odd("[" * 50_000, None)) as url:
        made = mouth(url, model, sha256, LONG)
        rows, _ = await asyncio.to_thread(remote, made, sound)
    np.testing.assert_allclose(rows, local(model, sound), atol=1e-5)


async def test_the_socket_is_guarded(bundle):
    app = expression_app(bundle, Limits(requests=1), key="sesame")
    async with serving(app) as url:
        address = url.replace("http", "ws") + "v1/expressions"
        key = {"Authorization": "Bearer sesame"}
        for headers in ({}, {"Authorization": "Bearer x"}, key | {"Origin": "http://evil.example"}):
            with pytest.raises(InvalidStatus):
                await connect(address, additional_headers=headers)
        async with connect(address, additional_headers=key) as socket:
            assert json.loads(await socket.recv())["fps"] == 25
            with pytest.raises(InvalidStatus):  # one place only
                await connect(address, additional_headers=key)
            await socket.send(b"odd")
            with pytest.raises(ConnectionClosed) as closed:
                await socket.recv()
            assert closed.value.rcvd.code == 1008


PIECE = bytes(4800)


def sayings(kind):
    """Messages that cost a server much and their sender nothing, or too many of the honest ones."""
    if kind == "pieces":
        return itertools.repeat(b"xx")
    words = {"starts": ["start"], "empty": [b""], "finishes": ["start", "finish"]}
    return itertools.cycle(words[kind])


@pytest.mark.parametrize("kind", ["starts", "empty", "finishes", "pieces"])
async def test_a_flood_without_sound_is_cut_off(bundle, monkeypatch, kind):
    monkeypatch.setattr(expression, "AT_ONCE", 200)
    async with (
        serving(expression_app(bundle)) as url,
        connect(f"{url.replace('http', 'ws')}v1/expressions") as socket,
    ):
        with contextlib.suppress(ConnectionClosed):
            for message in itertools.islice(sayings(kind), 240):
                await socket.send(message)
        with pytest.raises(ConnectionClosed) as closed:
            async with asyncio.timeout(20):
                while True:
                    await socket.recv()
    assert closed.value.rcvd.code == 1008
    assert ("per second" in closed.value.rcvd.reason) == (kind == "pieces")


@pytest.mark.parametrize("more", [PIECE, b"", "finish"])
async def test_after_the_end_of_a_sound_comes_a_beginning(bundle, more):
    async with (
        serving(expression_app(bundle)) as url,
        connect(f"{url.replace('http', 'ws')}v1/expressions") as socket,
    ):
        for message in ("start", PIECE, "finish", more):
            await socket.send(message)
        with pytest.raises(ConnectionClosed) as closed:
            for _ in range(4):
                await socket.recv()
    assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1008, expression.UNSTARTED)


def test_an_hour_of_honest_sentences_is_borne():
    now = 0.0
    pace = expression.Pace(lambda: now)
    for number in range(600):
        now += 6.0
        sentence = ["start", *[PIECE] * 60, *["finish"] * (number % 3 > 0)]  # some are interrupted
        assert not any(map(pace.fault, sentence))


async def test_the_end_of_a_sentence_of_whole_rows_sends_nothing_empty(bundle, model, sha256):
    async with serving(expression_app(bundle)) as url:
        made, sent = mouth(url, model, sha256), []
        made.ask = lambda _, message, first, fitting: (
            sent.append(message) or np.zeros((0, 32), np.float32)
        )
        lips = made.lips()
        lips.push(np.ones(960, np.float32))
        assert lips.push(np.zeros(0, np.float32)).shape == (0, 32)
        assert len(sent) == 1


class Counted:
    """Counts the connections to an application."""

    def __init__(self, app):
        self.app, self.sockets = app, 0

    async def __call__(self, scope, receive, send):
        self.sockets += scope["type"] == "websocket"
        await self.app(scope, receive, send)


def movement(page, utterance):
    """How far the mouth's values spread in an utterance."""
    rows = [m.expressions for m in page.messages(Speech) if m.utterance == utterance]
    return np.concatenate(rows).astype(np.float32)[:, :32].std(axis=0).max()


async def test_a_talk_goes_on_when_its_face_server_dies(bundle):
    app = Counted(expression_app(bundle))
    async with contextlib.AsyncExitStack() as stack:
        face = await stack.enter_async_context(contextlib.AsyncExitStack())
        settings = ChatSettings(
            expression=Expression("remote", await face.enter_async_context(serving(app)))
        )
        url, _ = await stack.enter_async_context(serving_avatar(bundle, settings))
        page, _ = await open_page(url, microphone=False)
        await page.wait(End)
        assert app.sockets == 1
        await face.aclose()
        await page.send(Text("Who are you?"))
        await page.wait(End, where=lambda m: m.utterance == 1)
        assert movement(page, 0) > 0.01 and movement(page, 1) > 0.01
        await page.close()
