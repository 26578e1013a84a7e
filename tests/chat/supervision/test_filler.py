"""What is said while a tool works, in virtual time: the tool's answer takes as long as it says."""

import asyncio
import contextlib
import json

import pytest
from fastapi import FastAPI

from ico3d.chat.settings.conversation import Patience
from ico3d.chat.settings.tools import Tool
from ico3d.chat.supervision.apologies import APOLOGIES, WAITING
from ico3d.chat.wire.protocol import Answer, End, State, Text
from ico3d.errors import SettingsError
from support.chat.scripted_server import Call, Script, running
from support.chat.scripted_talk import roles, talking

pytestmark = pytest.mark.slow

SCHEMA = {"properties": {"seconds": {"type": "number"}}, "required": ["seconds"]}


def after(*steps):
    """A model that takes the next step with each request: texts and calls."""
    steps = list(steps)
    return Script(lambda body: steps.pop(0))


def look(seconds):
    return Call("look", {"seconds": seconds})


@contextlib.asynccontextmanager
async def looking(bundle, script, **patience):
    """A talk whose model has a tool that takes as long as it is told."""
    app = FastAPI()

    @app.get("/look/{seconds}")
    async def answer(seconds: float):
        await asyncio.sleep(seconds)
        return "done"

    async with running(app) as port:
        url = f"http://127.0.0.1:{port}/look/{{seconds}}"
        tool = Tool("look", "Looks.", url, parameters=SCHEMA, seconds=30)
        settings = {"allow": (f"127.0.0.1:{port}",), "patience": Patience(**patience)}
        async with talking(bundle, script, tools=(tool,), **settings) as page:
            yield page


async def told(page, question="And?"):
    """The sentences of an answer whose last one ends in an exclamation mark."""
    since = len(page.messages(Answer))
    await page.send(Text(question))
    _, last = await page.wait(Answer, len(page.log), where=lambda m: m.text.endswith("!"))
    await page.wait(End, where=lambda m: m.utterance == last.utterance)
    await page.heard(last.utterance)
    return [answer.text for answer in page.messages(Answer)[since:]]


async def test_a_slow_tool_is_bridged_by_one_sentence_in_an_answer(bundle):
    script = after([look(3.0)], [look(4.0)], ["Found!"], [look(2.0)], ["Again!"])
    async with looking(bundle, script) as page:
        assert await told(page) == [WAITING["en"], "Found!"]
        states = [message.state for message in page.messages(State)]
        assert await told(page) == [WAITING["en"], "Again!"], "once in each answer"
    assert states[:4] == ["thinking", "speaking", "thinking", "speaking"]
    assert WAITING["en"] not in json.dumps(script.requests), "the model does not see it"
    assert roles(script.requests[2])[-2:] == ["assistant", "tool"]


@pytest.mark.parametrize(
    ("seconds", "patience", "filler"),
    [
        (0.9, {}, []),
        (1.1, {}, ["en"]),
        (2.4, {"tool": 2.5}, []),
        (9.0, {"tool": 0}, []),
        (1.5, {"apologies": "de-AT"}, ["de"]),
        (1.5, {"apologies": "nl"}, ["en"]),
    ],
)
async def test_it_waits_as_long_as_the_settings_say(bundle, seconds, patience, filler):
    async with looking(bundle, after([look(seconds)], ["Found!"]), **patience) as page:
        assert await told(page) == [*(WAITING[tongue] for tongue in filler), "Found!"]


async def test_it_is_not_said_over_the_models_own_words(bundle):
    async with looking(bundle, after(["Let me look. ", look(5.0)], ["Found!"])) as page:
        assert await told(page) == ["Let me look.", "Found!"]


async def test_whoever_asks_something_else_meanwhile_does_not_hear_it(bundle):
    async with looking(bundle, after([look(5.0)], ["Something else!"])) as page:
        await page.send(Text("Look!"))
        await asyncio.sleep(0.9)
        assert await told(page, "No, wait.") == ["Something else!"]
        await asyncio.sleep(5)
        assert [answer.text for answer in page.messages(Answer)] == ["Something else!"]


def test_it_is_there_in_every_language_of_apologies():
    assert WAITING.keys() == APOLOGIES.keys()
    with pytest.raises(SettingsError, match="tool must be 0"):
        Patience(tool=-1)
