"""Whoever runs a server learns of every failure, and of no word that was said."""

import asyncio
import contextlib
import io
import json
import logging
import re
import subprocess
import sys
from datetime import datetime

import numpy as np
import pytest
from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse, Response
from loguru import logger
from openai import AuthenticationError
from pipecat.frames.frames import ErrorFrame

from ico3d.chat.observing.failures import ReportedError, cause, cause_of
from ico3d.chat.observing.operator_log import (
    OperatorLog,
    StandardHandler,
    constant_part,
    set_up_log,
)
from ico3d.chat.wire.protocol import Answer, Speech, State, Text
from ico3d.errors import ServiceError, SettingsError
from ico3d.measure.talking.page import open_page
from support.chat.remote import serving
from support.chat.scripted_server import chunk

MARKER = "zanzibar"
SETTINGS = """
[recognition]
use = "openai"
url = "{url}v1"
[language]
use = "openai"
url = "{url}v1"
model = "any"
[voice]
use = "openai"
url = "{url}v1"
[patience]
language = 20.0
voice = 20.0
"""


def echoing():
    """A server of all three kinds that puts what it was asked into what it refuses."""
    app = FastAPI()

    def refusal(status, said):
        return JSONResponse(
            {"error": {"message": f"refused: {said}", "code": "no_such_key"}}, status
        )

    @app.post("/v1/chat/completions")
    async def chat(request: Request):
        body = await request.json()
        if "far" in str(body["messages"][-1]["content"]):
            return refusal(401, body["messages"])
        lines = [chunk({"content": f"You said {MARKER}."}), chunk({}, "stop"), "data: [DONE]\n\n"]
        return Response("".join(lines), media_type="text/event-stream")

    @app.post("/v1/audio/speech")
    async def speech(request: Request):
        body = await request.json()
        if MARKER in body["input"]:
            return refusal(400, body["input"])
        return Response(np.zeros(12000, np.int16).tobytes(), media_type="audio/pcm")

    @app.post("/v1/audio/transcriptions")
    async def transcription():
        return refusal(403, f"{MARKER} is what I heard")

    return app


@contextlib.asynccontextmanager
async def served_by_command(bundle_path, settings):
    """Yields the URL of `ico3d serve`, and a list that its standard error is in afterwards."""
    command = [sys.executable, "-m", "ico3d.cli", "serve", str(bundle_path), "--port", "0"]
    command += ["--settings", str(settings)]
    process = await asyncio.create_subprocess_exec(
        *command, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    errors = []
    try:
        line = (await process.stdout.readline()).decode()
        yield line.split()[3], errors
    finally:
        if process.returncode is None:
            process.terminate()
        errors.extend((await process.communicate())[1].decode().splitlines())


async def asked(page, text):
    since, before = len(page.log), page.messages(Speech)[-1].utterance
    await page.send(Text(text))
    await page.wait(Speech, since, where=lambda m: m.utterance > before, timeout=40)


@pytest.mark.slow
@pytest.mark.real_time  # the server is a process
async def test_each_failure_is_one_line_without_what_was_said(bundle_path, tmp_path, question):
    async with serving(echoing()) as url:
        settings = tmp_path / "settings.toml"
        settings.write_text(SETTINGS.format(url=url))
        async with served_by_command(bundle_path, settings) as (address, lines):
            page, _ = await open_page(address)
            await page.wait(Speech, timeout=40)
            await asked(page, f"Where is {MARKER}?")  # the answer cannot be spoken
            await asked(page, f"Is {MARKER} far?")  # there is no answer
            await page.wait(State, len(page.log), where=lambda m: m.state == "idle")
            since = len(page.log)
            page.say(question)  # it is not understood
            await page.wait(Answer, since, timeout=40)
            await page.close()
    log = "\n".join(lines)
    assert MARKER not in log, log
    for part, why in (("voice", "400"), ("language", "401"), ("recognition", "403")):
        told = [line for line in lines if f"{part} failed: " in line]
        assert len(told) == 1 and why in told[0], log
    assert len([line for line in lines if re.match(r"\d\d:", line)]) == 3, log


def records(log):
    return [re.sub(r"^\S+ ", "", line) for line in log.getvalue().splitlines()]


@pytest.fixture
def log():
    """What is written, and the clock."""
    file, clock = io.StringIO(), [0.0]
    log = OperatorLog(file, lambda: clock[0])
    number = logger.add(log.take, level="WARNING", format="{message}")
    handler = StandardHandler(log)
    logging.getLogger("someone").addHandler(handler)
    yield log, file, clock
    logging.getLogger("someone").removeHandler(handler)
    logger.remove(number)


def test_of_what_others_log_the_constant_part_is_shown(log):
    _, file, _ = log
    said = "my secret"
    logger.warning(f"Empty answer to {said}")
    logger.error(
        f"{said}: got {len(said)} words, "
        f"too many"
    )  # fmt: skip
    logger.error(said)
    logger.info("not shown")
    someone = logging.getLogger("someone")
    someone.warning("cannot bind %s", said)
    try:
        raise ValueError(said)
    except ValueError:
        someone.exception(f"in {said}")
        logger.exception("it broke")
    here = f"{__name__}.test_of_what_others_log_the_constant_part_is_shown"
    assert records(file) == [
        f"WARNING: {here}: Empty answer to …",
        f"ERROR: {here}: …: got … words, too many",
        f"ERROR: {here}",
        "WARNING: someone: cannot bind …",
        "ERROR: someone: in …: ValueError",
        f"ERROR: {here}: it broke: ValueError",
    ]


def test_of_what_others_fill_in_numbers_are_shown(log):
    _, file, _ = log
    someone, said = logging.getLogger("someone"), "my secret"
    someone.error("Cancel %s running task(s), timeout graceful shutdown exceeded", 2)
    someone.error(
        "%(count)d of %(what)s at 100%% in %(long).2f s", {"count": 3, "what": said, "long": 0.5}
    )
    someone.error("%-8s took %05.1f of %*d at %d", said, 1.25, 4, 7, 8)
    someone.error("100% of it: %s")
    assert records(file) == [
        "ERROR: someone: Cancel 2 running task(s), timeout graceful shutdown exceeded",
        "ERROR: someone: 3 of … at 100% in 0.5 s",
        "ERROR: someone: … took 1.25 of 7 at 8",
        "ERROR: someone: 100% of it: %s",
    ]


def test_lines_that_repeat_themselves_are_counted(log):
    written, file, clock = log
    for _ in range(1000):
        written.write("ERROR", "the same")
        clock[0] += 0.05
    written.write("ERROR", "another")
    assert records(file) == ["ERROR: the same", "ERROR: another"]
    clock[0] += 60
    written.write("ERROR", "the same")
    assert records(file)[2:] == ["ERROR: the same (999 more of these since)"]


def test_a_terminal_obeys_nothing_and_a_message_is_one_line():
    """Another server's words may stand in a message of our own."""
    file = io.StringIO()
    OperatorLog(file).write("ERROR", "it said \x1b[2J\x07 \u202e\nFAKE: all is well, Zoë")
    line = file.getvalue()
    assert line.endswith("it said \\x1b[2J\\x07 \\u202e\\nFAKE: all is well, Zoë\n")
    assert line.count("\n") == 1


def test_source_that_is_not_there_says_nothing():
    assert constant_part("/nowhere/at_all.py", 3) == ""


class Refusal(AuthenticationError):
    """As a client raises it."""

    def __init__(self, said):
        Exception.__init__(self, f"Error code: 401 - {said}")
        self.status_code, self.code = 401, "invalid_api_key"


def chained(error, behind):
    try:
        try:
            raise behind
        except type(behind) as known:
            raise error from known
    except type(error) as raised:
        return raised


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (Refusal("my secret"), "401 Refusal (invalid_api_key)"),
        (ConnectionRefusedError(111, "my secret"), "ConnectionRefusedError (111)"),
        (ServiceError("it gave no sound."), "it gave no sound"),
        (chained(ReportedError("my secret"), Refusal("x")), "401 Refusal (invalid_api_key)"),
        (
            chained(ConnectionError("my secret"), OSError(5, "x")),
            "ConnectionError from OSError (5)",
        ),
    ],
)
def test_a_cause_is_kinds_and_numbers(error, told):
    assert cause(error) == told
    assert cause_of(ErrorFrame("my secret", exception=error)) == told


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Error code: 429 - {'message': 'my secret'}", "429"),
        ("Error getting audio (status: 503, error: my secret)", "503"),
    ],
)
def test_a_status_is_found_where_the_exception_is_lost(text, told):
    assert cause_of(ErrorFrame(text)) == told
    assert "secret" not in cause_of(ErrorFrame("my secret of 401 nights"))


def test_lines_of_json_say_the_same():
    file, clock = io.StringIO(), [0.0]
    log = OperatorLog(file, lambda: clock[0], as_json=True)
    for clock[0] in (0.0, 1.0, 61.0):
        log.write("ERROR", 'voice failed: "401"')
    first, again = [json.loads(line) for line in file.getvalue().splitlines()]
    when = datetime.fromisoformat(first.pop("time"))
    assert when.tzinfo is not None
    assert first == {"level": "ERROR", "message": 'voice failed: "401"', "left_out": 0}
    assert again["left_out"] == 1
    with pytest.raises(SettingsError, match="--json-log"):
        set_up_log(verbose=True, as_json=True)
