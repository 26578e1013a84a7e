"""What is kept of a long talk is bounded, whether summaries are made of it or not."""

import asyncio
from dataclasses import replace

import pytest
from pipecat.processors.aggregators.llm_context import LLMContext

from ico3d.chat.memory import forget
from ico3d.chat.services import choose
from ico3d.chat.settings.conversation import ChatSettings, Choice, Memory
from ico3d.chat.wire.protocol import Text
from ico3d.measure.talking.scripted import Script
from support.chat.guests import Guest, open_sessions
from support.chat.virtual_time import run

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
