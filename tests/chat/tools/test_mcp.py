"""Functions of MCP servers: real servers, as a program and over HTTP."""

import asyncio
import contextlib
import json
import os
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from fastapi import FastAPI
from fastapi.responses import RedirectResponse
from loguru import logger
from pipecat.adapters.llm.schemas.function_schema import FunctionSchema
from pipecat.processors.aggregators.llm_context import NOT_GIVEN

from ico3d.chat import conversation
from ico3d.chat.settings.conversation import read_settings
from ico3d.chat.settings.mcp import McpServer
from ico3d.chat.tools import check_ready, extended
from ico3d.chat.tools.mcp import MOST_LETTERS, Connection, Connections
from ico3d.errors import MissingExtraError, SettingsError
from support.chat.mcp_server import COMMAND, museum
from support.chat.scripted_server import Call, Script, running
from support.chat.scripted_talk import ask, roles, talking

pytestmark = pytest.mark.slow

FILE = """
allow = ["mcp.example.org"]
[[mcp]]
name = "museum"
url = "https://mcp.example.org/mcp"
headers = { Authorization = "Bearer $MUSEUM_KEY" }
functions = ["opening_hours"]
[[mcp]]
name = "files"
command = ["files-server", "--read-only"]
environment = { FILES_KEY = "$FILES_KEY" }
seconds = 5
"""
KEY = "a-key-of-the-museum"


@pytest.fixture
def sdk():
    return pytest.importorskip("mcp", reason="the package mcp is not installed")


def test_a_settings_file_names_servers(tmp_path):
    path = tmp_path / "chat.toml"
    path.write_text(FILE)
    online, program = read_settings(path).mcp
    assert online.secrets == {"Authorization": "Bearer $MUSEUM_KEY"}
    assert online.functions == ("opening_hours",) and online.seconds == 10
    assert program.command == ("files-server", "--read-only") and program.seconds == 5
    assert program.secrets == {"FILES_KEY": "$FILES_KEY"}


def test_the_documentation_shows_settings_that_are_read(tmp_path):
    page = Path(__file__).parents[3] / "docs" / "conversation" / "tools.md"
    blocks = re.findall(r"^```toml\n(.*?)^```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    path = tmp_path / "chat.toml"
    found = [read_settings(path) for block in blocks if path.write_text(block, "utf-8")]
    assert [tool.headers for read in found for tool in read.tools] == [found[1].mcp[0].headers]
    assert [server.name for read in found for server in read.mcp] == ["museum", "files"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"museum"', '"files"', "is there twice"),
        ('"museum"', '"a museum"', "needs another name"),
        ('allow = ["mcp.example.org"]', "", "mcp.example.org, which is not in 'allow'"),
        ("https://mcp", "http://mcp", "unencrypted"),
        ("https://mcp", "file://mcp", "url must be an address"),
        ('url = "https://mcp.example.org/mcp"', "", "either a command or a url"),
        ("seconds = 5", 'url = "https://mcp.example.org/mcp"', "either a command or a url"),
        ("seconds = 5", "seconds = 0", "seconds"),
        ("seconds = 5", 'headers = { a = "b" }', "headers belong to a url"),
        ("FILES_KEY = ", '"A=B" = ', "a name that none can have"),
        ('"$FILES_KEY"', '"$"', "write $NAME"),
        ('"$FILES_KEY"', "3", "'environment' must be"),
        ("seconds = 5", "retries = 5", "no setting 'retries'"),
    ],
)
def test_wrong_servers_are_one_sentence(tmp_path, old, new, message):
    path = tmp_path / "chat.toml"
    assert old in FILE
    path.write_text(FILE.replace(old, new))
    with pytest.raises(SettingsError) as error:
        read_settings(path)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_what_a_server_needs_is_asked_for_before_visitors_come(monkeypatch):
    server = McpServer("files", ("files-server",), environment={"KEY": "$FILES_KEY"})
    check_ready((), ())
    with pytest.raises(SettingsError, match="mcp 'files' needs FILES_KEY in the environment"):
        check_ready((), (server,))
    monkeypatch.setenv("FILES_KEY", KEY)
    monkeypatch.setitem(sys.modules, "mcp", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'ico3d\[mcp\]'"):
        check_ready((), (server,))


def test_of_two_functions_with_one_name_the_first_stays():
    first, second, third = (FunctionSchema(name, "", {}, []) for name in ("a", "a", "b"))
    tools = extended(extended(NOT_GIVEN, [first]), [second, third])
    assert tools.standard_tools == [first, third]


def test_functions_that_no_model_can_be_told_are_left_out():
    def schema(name, about="", **properties):
        return FunctionSchema(name, about, properties, [])

    endless: dict = {}
    endless["x"] = endless
    offered = [
        schema("a", n={"maximum": 3}),
        schema("infinite", n={"maximum": float("inf")}),
        schema("none", n={"maximum": float("nan")}),
        schema("endless", n=endless),
        schema("long", "x" * MOST_LETTERS),
        schema("b", "y" * (MOST_LETTERS // 2)),
        schema("late", "z" * (MOST_LETTERS // 2)),
        schema("c"),
    ]
    messages = []
    sink = logger.add(messages.append, level="WARNING")
    try:
        kept = Connection(McpServer("museum", COMMAND))._readable(offered)
    finally:
        logger.remove(sink)
    assert [function.name for function in kept] == ["a", "b", "c"]
    (said,) = map(str, messages)
    assert "museum" in said and "without infinite, none, endless, long, late." in said


@pytest.mark.real_time
async def test_a_program_is_started_and_its_functions_called(sdk, monkeypatch):
    monkeypatch.setenv("MUSEUM_KEY_HERE", KEY)
    monkeypatch.setenv("OPENAI_API_KEY", "sk-somebody-elses")
    monkeypatch.setenv("PATH_OF_SDK", ":".join(filter(None, sys.path)))
    environment = {"MUSEUM_KEY": "$MUSEUM_KEY_HERE", "PYTHONPATH": "$PATH_OF_SDK"}
    museum = McpServer("museum", COMMAND, environment=environment, seconds=30)
    offered = []
    visit = Connections((museum,), offered.extend)
    visit.open()
    await asyncio.gather(*visit._tasks)
    functions = {function.name: function for function in offered}
    assert list(functions)[:2] == ["museum_opening_hours", "museum_told_to_it"]
    hours = functions["museum_opening_hours"]
    assert hours.description == "When the museum is open on a day." and hours.required == ["day"]
    assert await asked(hours, day="Monday") == {"result": "On Monday from ten to six."}
    told = await asked(functions["museum_told_to_it"])
    assert told == {"result": "… None"}, "it has its own key and no other, and tells the model none"
    assert "more than 16384 bytes" in (await asked(functions["museum_big"]))["error"]
    complaint = (await asked(hours))["error"]
    assert complaint.startswith("opening_hours failed: ") and "\n" not in complaint
    assert "Connection closed" in (await asked(functions["museum_leave"]))["error"]
    assert "result" in await asked(hours, day="Tuesday"), "it was started again"
    process = int((await asked(functions["museum_process"]))["result"])
    await visit.close()
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


STUBBORN = """
import json, os, pathlib, signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
pathlib.Path(sys.argv[1]).write_text(str(os.getpid()))
info = {"capabilities": {"tools": {}}, "serverInfo": {"name": "stubborn", "version": "1"}}
tools = {"tools": [{"name": "t", "inputSchema": {"type": "object"}}]}
for line in sys.stdin:
    asked = json.loads(line)
    known = {"initialize": info, "tools/list": tools}
    if asked.get("method") == "initialize":
        info["protocolVersion"] = asked["params"]["protocolVersion"]
    if "id" in asked:
        no = {"error": {"code": -32601, "message": "no such method"}}
        said = {"result": known[asked["method"]]} if asked["method"] in known else no
        print(json.dumps({"jsonrpc": "2.0", "id": asked["id"], **said}), flush=True)
while True:
    time.sleep(1)
"""
"""A server that takes no notice of the end of what it reads, nor of SIGTERM."""


@pytest.mark.real_time
async def test_a_program_that_does_not_want_to_end_is_ended(sdk, tmp_path):
    command = (sys.executable, "-c", STUBBORN, str(tmp_path / "pid"))
    connection = Connection(McpServer("m", command=command))
    assert [one.name for one in await connection.functions()] == ["m_t"]
    await connection.close()
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


@pytest.mark.real_time
async def test_answers_are_compared_with_no_schema_of_the_server(sdk, monkeypatch):
    """Its patterns may take for ever, and the server of visitors would wait for them."""
    monkeypatch.setenv("PATH_OF_SDK", ":".join(filter(None, sys.path)))
    environment = {"PYTHONPATH": "$PATH_OF_SDK"}
    connection = Connection(McpServer("museum", COMMAND, environment=environment, seconds=30))
    client = await connection._client()
    await client.list_tools()
    client.session._tool_output_schemas["opening_hours"] = {"required": ["nowhere"]}
    told = await connection.call("opening_hours", {"day": "Monday"})
    assert told == {"result": "On Monday from ten to six."}
    await connection.close()


async def asked(function, **arguments):
    """What the model is told of a call."""
    results = []

    async def result_callback(result):
        results.append(result)

    params = SimpleNamespace(arguments=arguments, result_callback=result_callback)
    await function.handler(params)
    return results[0]


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("command", "complaint"),
    [
        (("/nowhere/at/all",), "No such file"),
        (("true",), "Connection closed"),
        ((sys.executable, "-c", "import sys; sys.stdin.read()"), "within 0.2 seconds"),
    ],
)
async def test_a_program_that_is_none_is_one_sentence(sdk, command, complaint):
    connection = Connection(McpServer("none", command, seconds=0.2 if "-c" in command else 20))
    result = await connection.call("any", {})
    await connection.close()
    assert result["error"].startswith("any failed: ") and complaint in result["error"]


@contextlib.asynccontextmanager
async def online():
    """A museum over HTTP: its address, the headers that came, and whether it is now elsewhere."""
    seen, moved = [], []
    server = museum()
    app = server.streamable_http_app()

    async def door(scope, receive, send):
        if scope["type"] == "http":
            seen.append(dict(scope["headers"]))
            if moved:
                await RedirectResponse(moved[0])(scope, receive, send)
                return
        await app(scope, receive, send)

    async with running(door) as port:
        yield f"http://127.0.0.1:{port}/mcp", seen, moved


@pytest.mark.real_time
async def test_a_key_goes_to_its_server_alone(sdk, monkeypatch):
    monkeypatch.setenv("MUSEUM_KEY", KEY)
    elsewhere, stolen = FastAPI(), []

    @elsewhere.middleware("http")
    async def steal(request, _):
        stolen.append(dict(request.headers))

    async with online() as (url, seen, moved), running(elsewhere) as other:
        museum = McpServer("m", url=url, headers={"X-Key": "$MUSEUM_KEY"}, functions=("slow",))
        connection = Connection(museum)
        (slow,) = await connection.functions()
        assert slow.name == "m_slow"
        hours = await connection.call("opening_hours", {"day": "Monday"})
        assert hours == {"result": "On Monday from ten to six."}
        assert seen and all(headers[b"x-key"] == KEY.encode() for headers in seen)
        moved.append(f"http://127.0.0.1:{other}/mcp")
        away = await connection.call("opening_hours", {"day": "Monday"})
        assert set(away) == {"error"} and KEY not in json.dumps(away)
        moved.clear()
        assert "result" in await connection.call("opening_hours", {"day": "Monday"})
        await connection.close()
    assert not stolen


@pytest.mark.real_time
async def test_what_takes_too_long_is_given_up(sdk):
    async with online() as (url, _, _):
        connection = Connection(McpServer("m", url=url, seconds=0.5))
        late = await connection.call("slow", {})
        assert late == {"error": "slow failed: it did not answer within 0.5 seconds."}
        assert "result" in await connection.call("opening_hours", {"day": "Monday"})
        await connection.close()
    gone = Connection(McpServer("m", url="http://127.0.0.1:1/mcp"))
    assert "attempts failed" in (await gone.call("opening_hours", {}))["error"]
    await gone.close()


@pytest.mark.real_time
async def test_the_model_calls_a_server_and_says_what_it_answered(sdk, bundle, monkeypatch):
    offered = asyncio.Event()

    def noted(*given):
        offered.set()
        return extended(*given)

    def answer(body):
        if roles(body)[-1] == "tool":
            return [json.loads(body["messages"][-1]["content"])["result"]]
        return [Call("museum_opening_hours", {"day": "Monday"})]

    script = Script(answer)
    monkeypatch.setattr(conversation, "extended", noted)
    async with online() as (url, _, _):
        host = url.split("/")[2]
        museum = McpServer("museum", url=url, functions=("opening_hours", "slow"))
        nothing = McpServer("nothing", ("/nowhere/at/all",))
        async with talking(bundle, script, mcp=(museum, nothing), allow=(host,)) as page:
            await offered.wait()
            assert await ask(page, "When is it open?", 0) == ["On Monday from ten to six."]
    names = [tool["function"]["name"] for tool in script.requests[0]["tools"]]
    assert names == ["mood", "museum_opening_hours", "museum_slow"]
