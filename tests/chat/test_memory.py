"""What is kept of a long talk is bounded, summaries or none, and what is told of earlier visits."""

import asyncio
import json
from dataclasses import replace

import pytest
from pipecat.processors.aggregators.llm_context import LLMContext

from ico3d.chat.memory import NOTES, forget, recall
from ico3d.chat.services import choose
from ico3d.chat.settings.conversation import ChatSettings, Choice, Memory
from ico3d.chat.wire.codec import decode_client
from ico3d.chat.wire.protocol import Error, Notes, Text, Welcome
from ico3d.errors import ProtocolError
from ico3d.measure.talking.page import open_page
from ico3d.measure.talking.scripted import Script
from support.chat import scripted_server
from support.chat.guests import Guest, open_sessions
from support.chat.scripted_talk import ask, talking
from support.chat.serving import TYPED, serving
from support.chat.virtual_time import run

pytestmark = pytest.mark.slow

SMALL = Memory(tokens=200)


def talk(turns, letters=120):
    """Questions and answers of about `letters` / 4 tokens each."""
    roles = ["user", "assistant"] * turns
    return [{"role": role, "content": f"{n:03d} " + "x" * letters} for n, role in enumerate(roles)]


def test_the_oldest_questions_go_with_their_answers():
    context = LLMContext(talk(3))
    forget(context, SMALL)
    assert context.messages == talk(3)
    context = LLMContext(talk(50))
    forget(context, SMALL)
    kept = context.messages
    assert kept == talk(50)[-len(kept) :] and kept[0]["role"] == "user"
    assert 6 <= len(kept) <= 10  # 400 tokens, 41 in a message


def test_a_tools_result_is_not_kept_without_its_call():
    call = {"id": "1", "type": "function", "function": {"name": "clock", "arguments": "{}"}}
    turn = [
        {"role": "user", "content": "what time is it " + "x" * 400},
        {"role": "assistant", "content": "", "tool_calls": [call]},
        {"role": "tool", "tool_call_id": "1", "content": "x" * 400},
        {"role": "assistant", "content": "noon " + "x" * 400},
    ]
    context = LLMContext(turn * 5)
    forget(context, SMALL)
    assert context.messages == turn


def test_the_latest_question_stays_however_long():
    context = LLMContext([*talk(9), {"role": "user", "content": "y" * 9000}])
    forget(context, SMALL)
    assert context.messages == [{"role": "user", "content": "y" * 9000}]


@pytest.mark.parametrize("notes", [True, False])
def test_a_long_talk_is_kept_in_bounds(bundle, notes):
    """With notes, and with a model whose summaries fail."""

    async def chat():
        services = Script().services()
        if notes:
            offline = choose(ChatSettings(language=Choice("persona-notes")))
            services = replace(services, language=offline.language)
        sizes = []
        async with open_sessions(bundle, services, ChatSettings(memory=SMALL)) as sessions:
            guest = await Guest.enter(sessions)
            await asyncio.sleep(5)
            for number in range(30):
                await guest.session.conversation.handle(Text(f"question {number} " + "x" * 300))
                await asyncio.sleep(10)
                sizes.append(len(guest.session.conversation._context.messages))
            await guest.leave()
        return sizes

    sizes = run(chat())
    assert max(sizes) <= 10 and min(sizes[5:]) >= 2


VISITS = Memory(visits=True)
TOLD = "“My name is Grace.” “I like old clocks.”"
EARLIER = ["My name is Grace.", "I like\nold  clocks.\x00", " \t"]


async def test_what_was_said_in_earlier_visits_is_told_as_the_visitors_own_words(bundle):
    script = scripted_server.Script(lambda body: ["Hello, Grace!"])
    async with talking(bundle, script, memory=VISITS) as page:
        assert page.messages(Welcome)[0].remembers
        await page.send(Notes(EARLIER))
        assert await ask(page, "Do you remember me?", 0) == ["Hello, Grace!"]
        await page.send(Notes(["I am somebody else."]))
        _, error = await page.wait(Error)
    assert "only once" in error.message
    system, earlier, question = script.requests[0]["messages"]
    assert "Grace" not in system["content"], "nobody's notes are instructions"
    assert earlier == {"role": "user", "content": NOTES.format(notes=TOLD)}
    assert question["content"] == "Do you remember me?"


@pytest.mark.parametrize("texts", [[], [""], ["  "], 16 * ["x"], 17 * ["x"], ["x" * 201], [3]])
def test_pages_cannot_send_more_than_a_few_sentences(texts):
    frame = json.dumps({"type": "notes", "texts": texts})
    if texts in ([], ["  "], 16 * ["x"]):
        context = LLMContext()
        recall(context, decode_client(frame).texts)
        assert len(context.messages) == (1 if "x" in texts else 0)
    else:
        with pytest.raises(ProtocolError, match=r"notes\.texts"):
            decode_client(frame)


@pytest.mark.parametrize(("memory", "language"), [(Memory(), "openai"), (VISITS, "persona-notes")])
async def test_nothing_is_taken_unless_the_settings_allow_it_and_the_model_reads_it(
    bundle, memory, language
):
    options = {"url": "http://127.0.0.1:9/v1", "model": "tiny"} if language == "openai" else {}
    settings = replace(TYPED, memory=memory, language=Choice(language, options))
    async with serving(bundle, settings) as (url, _):
        page, welcome = await open_page(url, microphone=False)
        assert not welcome.remembers
        await page.send(Notes(["My name is Grace."]))
        _, error = await page.wait(Error)
        assert "do not allow it" in error.message
        await page.close()
