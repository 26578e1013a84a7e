"""Users' tools: what settings may say, and where calls may not go."""

import asyncio
import contextlib
import sys
from itertools import product

import pytest
from fastapi import FastAPI, Request
from fastapi.responses import RedirectResponse, Response

from ico3d.chat.settings.conversation import Memory, read_settings
from ico3d.chat.settings.tools import Tool
from ico3d.chat.tools.http import (
    MOST_BYTES,
    MOST_DEPTH,
    MOST_RECEIVED,
    Refused,
    answer,
    check_address,
)
from ico3d.errors import SettingsError
from support.chat.scripted_server import running

FILE = """
allow = ["api.example.org", "127.0.0.1:9000"]
[memory]
tokens = 2000
[[tools]]
name = "weather"
description = "The weather of a city."
url = "https://api.example.org/{city}"
[tools.parameters]
type = "object"
required = ["city"]
properties = { city = { type = "string" }, days = { type = "integer" } }
[[tools]]
name = "light"
description = "Switches the light."
url = "http://127.0.0.1:9000/light"
method = "POST"
seconds = 2
"""


def test_a_settings_file_holds_tools_and_memory(tmp_path):
    path = tmp_path / "chat.toml"
    path.write_text(FILE)
    settings = read_settings(path)
    weather, light = settings.tools
    assert weather.properties == {"city": {"type": "string"}, "days": {"type": "integer"}}
    assert weather.required == weather.placeholders == ["city"] and weather.method == "GET"
    assert light == Tool(
        "light", "Switches the light.", "http://127.0.0.1:9000/light", "POST", seconds=2.0
    )
    assert settings.memory == Memory(2000)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"api.example.org", ', "", "api.example.org, which is not in 'allow'"),
        ('"127.0.0.1:9000"', '"127.0.0.1"', "127.0.0.1:9000, which is not in 'allow'"),
        ('"light"', '"weather"', "is there twice"),
        ('"light"', '"mood"', "needs another name"),
        ('"light"', '"switch it"', "needs another name"),
        ('"POST"', '"DELETE"', "GET or POST"),
        ("seconds = 2", "seconds = 0", "seconds"),
        ('"http://127.0.0.1:9000/light"', '"file:///etc/passwd"', "http or https"),
        ('"http://127.0.0.1:9000/light"', '"http://me:pw@127.0.0.1:9000/"', "http or https"),
        ("https://api.example.org/{city}", "https://{city}/", "variable host"),
        ('required = ["city"]', "", "must require every parameter"),
        ('type = "object"', 'type = "array"', "JSON schema"),
        ('name = "light"', "", "'name' is missing"),
        ("seconds = 2", "retries = 2", "no setting 'retries'"),
        ("seconds = 2", 'headers = { A = "$" }', "write $NAME"),
        ("seconds = 2", "headers = { A = 3 }", "'headers' must be"),
        ("[[tools]]", "[tools]", "."),
        ("tokens = 2000", "tokens = 3", "at least 200"),
    ],
)
def test_wrong_tools_are_one_sentence(tmp_path, old, new, message):
    path = tmp_path / "chat.toml"
    assert old in FILE
    path.write_text(FILE.replace(old, new))
    with pytest.raises(SettingsError) as error:
        read_settings(path)
    assert message in str(error.value) and "\n" not in str(error.value)


class House:
    """A server with rooms, and what was asked of it."""

    def __init__(self):
        self.seen, self.keys, self.other = [], [], 0

    def app(self):
        app = FastAPI()

        @app.api_route("/echo/{rest:path}", methods=["GET", "POST"])
        async def echo(request: Request):
            body = await request.json() if request.method == "POST" else None
            self.seen.append((request.scope["raw_path"].decode(), dict(request.query_params), body))
            return {"ok": True}

        @app.api_route("/go/{where}", methods=["GET", "POST"])
        async def go(where: str, request: Request):
            self.seen.append(("/go", dict(request.query_params), None))
            home = request.url.netloc
            places = {
                "home": "/echo/again",
                "round": "/go/round",
                "key": "/key",
                "thief": f"http://127.0.0.1:{self.other}/key",
                "localhost": f"http://localhost:{request.url.port}/echo/",
                "port": f"http://127.0.0.1:{self.other}/echo/",
                "file": "file:///etc/passwd",
                "odd": f"ftp://{home}/",
            }
            return RedirectResponse(places[where])

        @app.get("/big")
        async def big(size: int):
            return Response("x" * size, media_type="text/plain")

        @app.get("/halves")
        async def halves():
            return Response('{"a": "\\ud83d"}', media_type="application/json")

        @app.get("/deep")
        async def deep(depth: int):
            return Response("[" * depth + "]" * depth, media_type="application/json")

        @app.get("/slow")
        async def slow():
            await asyncio.sleep(5)

        @app.api_route("/key", methods=["GET", "POST"])
        async def key(request: Request):
            self.keys.append(request.headers.get("X-Key"))
            return {"no such key": request.headers.get("X-Key")}

        @app.get("/none")
        async def none():
            return Response("No such page.", 404)

        return app


@contextlib.asynccontextmanager
async def house():
    """Yields it, and a function that calls a tool at one of its places."""
    rooms = House()
    async with running(rooms.app()) as port:
        allow = (f"127.0.0.1:{port}",)

        async def call(place, arguments=None, method="GET", seconds=5.0, allow=allow, headers=None):
            names = {name: {} for name in (arguments or {})}
            required = [name for name in names if f"{{{name}}}" in place]
            schema = {"properties": names, "required": required}
            url = f"http://127.0.0.1:{port}{place}"
            tool = Tool("t", "Test.", url, method, schema, seconds, headers or {})
            return await answer(tool, arguments or {}, allow)

        yield rooms, call


async def test_parameters_go_into_path_query_or_body():
    async with house() as (rooms, call):
        values = {"a": "São Paulo/../x?y=1#z", "b": 2, "c": [True, "ü"]}
        assert await call("/echo/{a}", values) == {"status": 200, "body": {"ok": True}}
        await call("/echo/", values, "POST")
        await call("/echo/?q={q}", {"q": "a&b=c+d %20#ü"})
    path, query, _ = rooms.seen[0]
    assert path == "/echo/S%C3%A3o%20Paulo%2F..%2Fx%3Fy=1%23z", "all of it is one part"
    assert query == {"b": "2", "c": '[true, "ü"]'}
    assert rooms.seen[1] == ("/echo/", {}, values)
    assert rooms.seen[2][1] == {"q": "a&b=c+d %20#ü"}


async def test_halves_of_characters_do_not_come_in():
    async with house() as (_, call):
        assert await call("/halves") == {"status": 200, "body": {"a": "\ufffd"}}


@pytest.mark.parametrize("depth", [5, 500, 950, 1500])
async def test_an_answer_of_brackets_alone_is_a_text(depth):
    async with house() as (_, call):
        body = (await call(f"/deep?depth={depth}"))["body"]
        assert isinstance(body, str) == (depth > MOST_DEPTH)


def nested(depth):
    """A list in a list, and so on."""
    value = []
    for _ in range(depth - 1):
        value = [value]
    return value


@pytest.mark.parametrize("limit", [1000, 3000])
async def test_what_is_nested_deep_is_no_failure_of_the_talk(limit):
    # PyTorch's compiler raises the interpreter's limit for good, to 2,000.
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, before))
    try:
        async with house() as (rooms, call):
            brackets = "[" * 8_000 + "]" * 8_000
            assert await call("/deep?depth=8000") == {"status": 200, "body": brackets}
            for depth, method in product((MOST_DEPTH, 1_100, 100_000), ("GET", "POST")):
                told = await call("/echo/", {"a": nested(depth)}, method)
                assert told == {"error": "t failed: its arguments are nested too deep."}
            assert not rooms.seen
            assert "body" in await call("/echo/", {"a": nested(MOST_DEPTH - 1)}, "POST")
    finally:
        sys.setrecursionlimit(before)


async def test_arguments_that_do_not_fit_are_not_sent():
    tool = Tool("t", "Test.", "http://127.0.0.1:1/{a}", parameters=SCHEMA)
    for arguments in ({}, {"a": "x", "b": 1}, {"a": ".."}, {"a": ""}):
        result = await answer(tool, arguments, ("127.0.0.1:1",))
        assert set(result) == {"error"} and "reached" not in result["error"]


SCHEMA = {"properties": {"a": {"type": "string"}}, "required": ["a"]}


async def test_redirects_stay_on_their_host():
    async with house() as (rooms, call), running(House().app()) as other:
        rooms.other = other
        assert (await call("/go/home"))["body"] == {"ok": True}
        for where in ("localhost", "port", "file", "odd"):
            assert "leads elsewhere" in (await call(f"/go/{where}"))["error"]
        assert "redirects too often" in (await call("/go/round"))["error"]
        assert "redirects what is sent" in (await call("/go/home", {"a": 1}, "POST"))["error"]


async def test_a_key_goes_to_its_host_alone_and_not_to_the_model(monkeypatch):
    monkeypatch.setenv("WEATHER_KEY", "a-key-of-the-weather")
    headers, thief = {"X-Key": "$WEATHER_KEY"}, House()
    async with house() as (rooms, call), running(thief.app()) as rooms.other:
        for place, method in (("/key", "GET"), ("/key", "POST"), ("/go/key", "GET")):
            told = await call(place, method=method, headers=headers)
            assert told == {"status": 200, "body": {"no such key": "…"}}
        assert "leads elsewhere" in (await call("/go/thief", headers=headers))["error"]
        assert rooms.keys == ["a-key-of-the-weather"] * 3 and not thief.keys
        monkeypatch.delenv("WEATHER_KEY")
        told = await call("/key", headers=headers)
        assert told["error"].endswith("needs WEATHER_KEY in the environment.")


async def test_time_and_size_are_limited():
    async with house() as (_, call):
        assert (await call(f"/big?size={MOST_BYTES}"))["body"] == "x" * MOST_BYTES
        assert "more than" in (await call(f"/big?size={MOST_BYTES + 1}"))["error"]
        assert await call("/slow", seconds=0.2) == {"error": "t did not answer within 0.2 seconds."}
        assert await call("/none") == {"status": 404, "body": "No such page."}


@pytest.mark.parametrize("head", ["100 Continue", "103 Early Hints"])
async def test_heads_before_an_answer_have_an_end(head):
    sent = 0

    async def flood(reader, writer):
        nonlocal sent
        await reader.readuntil(b"\r\n\r\n")
        with contextlib.suppress(ConnectionError):
            while True:
                writer.write(f"HTTP/1.1 {head}\r\n\r\n".encode() * 100)
                sent += 100
                await writer.drain()
        writer.close()

    async with await asyncio.start_server(flood, "127.0.0.1", 0) as flooding:
        place = f"127.0.0.1:{flooding.sockets[0].getsockname()[1]}"
        said = await answer(Tool("t", "Test.", f"http://{place}/", seconds=3.0), {}, (place,))
    assert said == {"error": f"t failed: its answer has more than {MOST_BYTES} bytes."}
    assert sent < 10 * MOST_RECEIVED


async def test_private_addresses_must_be_listed_themselves():
    async with house() as (rooms, call):
        assert "private address 127.0.0.1" in (await call("/echo/", allow=()))["error"]
        assert not rooms.seen
    async with running(House().app()) as port:
        tool = Tool("t", "Test.", f"http://localhost:{port}/echo/")
        refused = await answer(tool, {}, ())
        assert refused["error"].startswith("t cannot be reached: localhost is at the private")
        assert (await answer(tool, {}, (f"localhost:{port}",)))["status"] == 200


@pytest.mark.parametrize(
    "address",
    ["127.0.0.1", "10.1.2.3", "192.168.0.1", "169.254.169.254", "::1", "fe80::1%eth0",
     "::ffff:127.0.0.1", "0.0.0.0", "224.0.0.1", "fd00::1", "100.64.0.1",
     "64:ff9b::7f00:1", "64:ff9b:1::a00:1", "2002:7f00:1::", "::127.0.0.1", "fec0::1"],
)  # fmt: skip
def test_addresses_that_lead_into_the_house(address):
    with pytest.raises(Refused):
        check_address(address, "api.example.org", 443, ("api.example.org", "localhost"))


def test_listed_addresses_are_called_at_their_port_only():
    for public in ("93.184.215.14", "2606:2800:21f::1", "64:ff9b::5db8:d70e"):
        check_address(public, "example.org", 443, ())
    check_address("192.168.0.5", "nas.local", 80, ("nas.local", "192.168.0.5"))
    check_address("::1", "localhost", 9000, ("localhost:9000",))
    check_address("fd00::5", "nas.local", 8000, ("[fd00::5]:8000",))
    for port, allow in [(9000, ("127.0.0.1",)), (80, ("127.0.0.1:9000",))]:
        with pytest.raises(Refused):
            check_address("127.0.0.1", "127.0.0.1", port, allow)
