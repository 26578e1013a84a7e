"""The server's edge: foreign pages, garbage, floods; and that it goes on serving."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import closing

import httpx
import numpy as np
import pytest
from fastapi import FastAPI, WebSocketDisconnect
from threadpoolctl import threadpool_info, threadpool_limits
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from ico3d.bundle.persona import Persona
from ico3d.chat.performing.face import open_face
from ico3d.chat.serving.echo import echo
from ico3d.chat.serving.guard import is_own
from ico3d.chat.serving.server import bind, listen, make_server
from ico3d.chat.wire import protocol
from ico3d.chat.wire.codec import decode_server, encode
from ico3d.chat.wire.protocol import Ack, Audio, Error, Hello, Speech, Text, Welcome
from ico3d.cli import main
from ico3d.errors import BundleError, SettingsError
from ico3d.measure.talking.page import open_page
from support.chat.serving import serving, visiting

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("host", "origin", "own"),
    [
        ("127.0.0.1:8765", None, True),
        ("localhost:8765", "http://localhost:8765", True),
        ("localhost:8765", "http://127.0.0.1:8765", True),
        ("[::1]:8765", "http://[::1]:8765", True),
        ("localhost.:8765", "http://localhost.:8765", True),
        ("localhost.:8765", "http://localhost:8765", True),
        ("localhost..:8765", None, False),
        (".:8765", None, False),
        ("localhost:8765", "http://localhost:3000", False),
        ("localhost:8765", "http://evil.example", False),
        ("localhost:8765", "null", False),
        ("localhost:8765", "file://", False),
        ("localhost:8765", "http://[", False),
        ("localhost:8765", "http://[::1", False),
        ("localhost:8765", "http://localhost.evil.example:8765", False),
        ("evil.example:8765", "http://evil.example:8765", False),
        ("evil.example:8765", None, False),
        ("192.168.1.5:8765", None, False),
        ("localhost:99999999", None, False),
        ("user@localhost:8765", None, False),
        (None, None, False),
        ("", None, False),
    ],
)
def test_only_own_names_pass_on_loopback(host, origin, own):
    assert is_own(host, origin, "127.0.0.1") is own


def test_numbers_pass_on_a_public_address_but_no_foreign_names():
    assert is_own("192.168.1.5:80", "http://192.168.1.5:80", "0.0.0.0")
    assert not is_own("evil.example:80", "http://evil.example:80", "0.0.0.0")
    assert not is_own("192.168.1.5:80", "http://192.168.1.6:80", "0.0.0.0")


async def test_http_serves_the_bundle_and_nothing_else(served, bundle):
    url, _ = served
    async with visiting(url) as client:
        assert (await client.get("/health")).json() == {"ok": True}
        manifest = await client.get("/bundle/manifest.json")
        assert manifest.json()["persona"]["name"] == "Random"
        head = await client.get("/bundle/head.safetensors")
        assert head.content == bundle.read("head.safetensors")
        again = await client.get(
            "/bundle/head.safetensors", headers={"If-None-Match": head.headers["etag"]}
        )
        assert again.status_code == 304 and not again.content
        for name in ("nothing", "..%2f..%2fetc%2fpasswd", "%2e%2e/x"):
            assert (await client.get(f"/bundle/{name}")).status_code == 404
        assert "script-src 'self'" in head.headers["content-security-policy"]
        assert (await client.get("/health", headers={"Host": "evil.example"})).status_code == 403
        foreign = await client.get("/health", headers={"Origin": "http://evil.example"})
        assert foreign.status_code == 403


async def test_a_request_with_two_hosts_is_refused(served):
    """Written by hand, for clients refuse to send it."""
    own = served[0].partition("://")[2].strip("/")
    host, _, port = own.rpartition(":")
    lines = [f"Host: {own}", "Host: evil.example", "Connection: close", "", ""]
    for hosts, status in ((lines[:1], b"200"), (lines[:2], b"403")):
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write("\r\n".join(["GET /health HTTP/1.1", *hosts, *lines[2:]]).encode())
        assert (await asyncio.wait_for(reader.read(), 10)).split()[1] == status
        writer.close()


async def test_figures_are_on_a_port_of_their_own(typed):
    url, sessions = typed
    page, welcome = await open_page(url, microphone=False)
    async with visiting(url) as client:
        assert (await client.get("/metrics")).status_code == 404
        figures = await client.get(sessions.monitor.publish("127.0.0.1", 0))
        assert figures.headers["content-type"].startswith("text/plain; version=")
        lines = figures.text.splitlines()
        assert "ico3d_sessions 1.0" in lines and "ico3d_connections 1.0" in lines
        assert "ico3d_waiting 0.0" in lines
        assert welcome.session not in figures.text
        await page.send_frame("garbage")
        await page.wait(Error)
        await page.close()
        while "ico3d_connections 0.0" not in lines:
            await asyncio.sleep(0.05)
            lines = (await client.get(str(figures.url))).text.splitlines()
    assert "ico3d_sessions 0.0" in lines  # it left: what only drops comes back
    assert 'ico3d_errors_total{where="protocol"} 1.0' in lines


async def test_a_personas_file_shows_its_name_and_keeps_its_notes(bundle):
    ada = Persona("Ada", "Hello.", ("The safe is open.",), "Sly.", forbidden=("keys",))
    async with serving(bundle, persona=ada) as (url, _), visiting(url) as client:
        shown = (await client.get("/bundle/manifest.json")).json()
    assert shown["persona"] == {"name": "Ada", "greeting": "Hello.", "notes": []}
    own = json.loads(bundle.read("manifest.json"))
    assert shown == own | {"persona": shown["persona"]}


async def test_a_body_alone_is_served_without_a_conversation(body):
    async with serving(body) as (url, _), visiting(url) as client:
        for name in ("body/0000.safetensors", "body/0001.safetensors", "manifest.json"):
            assert (await client.get(f"/bundle/{name}")).content == body.read(name)
        for name in (
            "body/0002.safetensors",
            "body",
            "body/../manifest.json/x",
            "head.safetensors",
        ):
            assert (await client.get(f"/bundle/{name}")).status_code == 404
        with pytest.raises(InvalidStatus):
            await connect(address(url))
    with pytest.raises(BundleError, match="no head to talk with"):
        open_face(body)


@pytest.mark.parametrize("header", [{"Origin": "http://evil.example"}, {"Host": "evil.example"}])
async def test_a_foreign_page_gets_no_socket(served, header):
    url, sessions = served
    with pytest.raises(InvalidStatus) as refused:
        if "Host" in header:
            host, port = url.split("/")[2].split(":")
            await connect(f"ws://evil.example:{port}/ws", host=host, port=int(port), proxy=None)
        else:
            await connect(address(url), additional_headers=header)
    assert refused.value.response.status_code == 403
    assert len(sessions) == 0


def address(url):
    return url.replace("http", "ws") + "ws"


async def farewell(socket):
    """The last error before the server closed, and the code."""
    error = None
    try:
        while True:
            message = decode_server(await asyncio.wait_for(socket.recv(), 10))
            error = message if isinstance(message, Error) else error
    except ConnectionClosed:
        return error, socket.close_code


@pytest.mark.parametrize(
    ("first", "code"),
    [
        ("garbage", 1008),
        (b"\xff\xff\xff\xff", 1008),
        (json.dumps({"type": "text", "text": "a"}), 1008),
        (json.dumps({"type": "hello", "version": 99, "session": None, "last_index": -1}), 1008),
        (
            json.dumps(
                {"type": "hello", "version": protocol.VERSION, "session": 5, "last_index": -1}
            ),
            1008,
        ),
        ("x" * 20_000, 1009),
        (b"x" * 70_000, 1009),
    ],
)
async def test_a_bad_hello_is_answered_in_one_sentence(served, first, code):
    url, sessions = served
    async with connect(address(url)) as socket:
        await socket.send(first)
        error, closed = await farewell(socket)
    assert closed == code and len(sessions) == 0
    if len(first) < 65_536:  # beyond it the WebSocket library closes by itself
        assert error.fatal and not error.again
        assert "\n" not in error.message and len(error.message) < 300


async def test_garbage_and_floods_end_their_connection_only(typed):
    url, _ = typed
    good, _ = await open_page(url, microphone=False)
    await good.wait(Speech)
    hello = encode(Hello(protocol.VERSION, None, -1))
    text = encode(Text("who are you"))
    frames = ["[" * 9999, "null", b"", b"\x02\0\0\0{}", encode(Error("mine", fatal=True)), hello]
    for flood in (frames, [text] * 600):
        async with connect(address(url)) as socket:
            await socket.send(hello)
            assert isinstance(decode_server(await socket.recv()), Welcome)
            with pytest.raises(ConnectionClosed):
                for frame in flood * 50:
                    await socket.send(frame)
                await socket.wait_closed()
                raise ConnectionClosed(None, None)
            assert socket.close_code == 1008
    since = len(good.log)
    await good.send(Text("who are you"))
    _, speech = await good.wait(Speech, since)
    assert speech.utterance == 1
    await good.close()


async def test_every_binary_frame_is_acknowledged_also_a_refused_one(typed):
    url, _ = typed
    page, _ = await open_page(url, microphone=False)
    second = np.zeros(16_000, np.int16)
    for at in range(3):
        await page.send(Audio(16_000 * at, second))
    await page.send(Text("who are you"))
    await page.send_frame(b"no frame of ours")
    await page.wait(Ack, where=lambda ack: ack.frames == 4)
    assert [ack.frames for ack in page.messages(Ack)] == [1, 2, 3, 4]
    assert page.messages(Error)
    await page.close()


@pytest.mark.slow
def test_serve_prints_where_it_is_and_ends_on_interrupt(bundle_path, tmp_path):
    command = [sys.executable, "-m", "ico3d.cli", "serve", str(bundle_path), "--port", "0"]
    command += ["--log", str(tmp_path / "turns.jsonl")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with closing(process.stdout), closing(process.stderr):
        line = process.stdout.readline()
        assert line.startswith("Random is at http://127.0.0.1:")
        response = None
        for _ in range(200):
            try:
                response = httpx.get(f"{line.split()[3]}health")
                break
            except httpx.ConnectError:
                process.poll()
        assert response is not None and response.json() == {"ok": True}
        os.kill(process.pid, signal.SIGINT)
        assert process.wait(10) in (0, 130, -signal.SIGINT)
        assert "stand-ins" in process.stdout.read()
        assert "Traceback" not in process.stderr.read()
        assert (tmp_path / "turns.jsonl").read_text() == ""  # nobody has asked


async def test_small_messages_leave_at_once():
    """None waits until the page has acknowledged the one before."""
    accepted = asyncio.Queue()
    listener = bind("127.0.0.1", 0)
    port = listener.getsockname()[1]
    async with await asyncio.start_server(lambda _, out: accepted.put(out), sock=listener):
        _, page = await asyncio.open_connection("127.0.0.1", port)
        served = await accepted.get()
        own = served.get_extra_info("socket")
        assert own.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        for side in (page, served):
            side.close()
            await side.wait_closed()


def test_a_taken_port_is_one_sentence():
    with closing(bind("127.0.0.1", 0)) as listener:
        listener.listen()
        with pytest.raises(SettingsError, match="--port"):
            bind("127.0.0.1", listener.getsockname()[1])


def test_a_bundle_that_is_none_is_one_sentence(tmp_path, capsys):
    (tmp_path / "x.ico3d").write_bytes(b"no bundle")
    assert main(["serve", str(tmp_path / "x.ico3d"), "--port", "0"]) == 1
    assert capsys.readouterr().err.startswith("ico3d: ")


@pytest.mark.slow
def test_a_server_needs_no_torch(bundle_path):
    code = (
        "import sys; from ico3d.chat.serving import server; from ico3d.bundle.format import Bundle;"
        "from ico3d.chat.settings.conversation import ChatSettings;"
        f"server.open_avatar(Bundle.open({str(bundle_path)!r}), ChatSettings());"
        "assert not {'torch', 'numba', 'scipy', 'transformers', 'openai'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


async def test_messages_are_not_compressed(served):
    async with connect(address(served[0]), compression="deflate") as socket:
        assert socket.protocol.extensions == []


def test_a_server_multiplies_in_one_thread():
    with threadpool_limits(2, user_api="blas"):
        make_server(FastAPI())
        pools = [pool for pool in threadpool_info() if pool["user_api"] == "blas"]
        assert pools and {pool["num_threads"] for pool in pools} == {1}


async def test_who_leaves_while_an_echo_is_sent_is_no_fault():
    class Left:
        """A page that has gone when it is answered."""

        async def accept(self):
            pass

        async def receive_text(self):
            return "a"

        async def send_text(self, text):
            raise WebSocketDisconnect(1006)

        async def close(self):
            raise WebSocketDisconnect(1006)

    await echo(Left())


def test_the_later_of_two_that_open_a_port_at_once_says_that_it_is_taken():
    with closing(bind("127.0.0.1", 0)) as first:
        port = first.getsockname()[1]
        with closing(bind("127.0.0.1", port)) as second:  # the first does not listen yet
            listen(first)
            with pytest.raises(SettingsError, match=f"port {port} on 127.0.0.1 cannot be used"):
                listen(second)
