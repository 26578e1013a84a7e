"""Language models over HTTP: a scripted OpenAI-compatible server and the whole conversation."""

import asyncio
import json
import re
import threading

import numpy as np
import pytest
from fastapi import FastAPI
from fastapi.responses import RedirectResponse, Response, StreamingResponse
from openai.resources.chat.completions import completions

from ico3d.chat.memory import PROMPT
from ico3d.chat.performing.moods import EASE, FACES
from ico3d.chat.services import choose, chosen
from ico3d.chat.services.language import PROVIDERS, local, openai
from ico3d.chat.services.language.compatible import MOST_ROUNDS
from ico3d.chat.services.language.instruction import instruction
from ico3d.chat.services.language.servers import first_server, language_models
from ico3d.chat.services.provider import Context
from ico3d.chat.settings.conversation import ChatSettings, Choice, Memory
from ico3d.chat.settings.tools import Tool
from ico3d.chat.wire.protocol import Answer, End, Interrupt, Speech, State, Stop, Text, Timeline
from ico3d.common.expression import EYE_NAMES, SPEECH_SIZE
from ico3d.errors import SettingsError
from ico3d.speech import emphasis
from support.chat.dripping import dripping
from support.chat.pages import FollowingPlayer
from support.chat.scripted_server import Call, Script, running
from support.chat.scripted_talk import ADA, ask, roles, talking

pytestmark = pytest.mark.slow


async def test_a_conversation_keeps_its_thread_and_the_key_stays_at_home(bundle, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "secret")
    said = ["Äpfel ", "kosten 2,5", "0 €. ", "你好! 🙂"]
    script = Script(lambda body: said)
    async with talking(bundle, script) as page:
        assert await ask(page, "Was kosten Äpfel?", 0) == ["Äpfel kosten 2,50 €.", "你好! 🙂"]
        await page.heard(0)
        await ask(page, "And pears?", 1)
    assert script.keys == ["Bearer none"] * 2
    assert script.requests[0]["messages"][0]["content"] == instruction(ADA)
    assert roles(script.requests[1]) == ["system", "user", "assistant", "user"]
    assert script.requests[1]["messages"][-1] == {"role": "user", "content": "And pears?"}
    assert script.requests[1]["messages"][-2]["content"] == "Äpfel kosten 2,50 €. 你好! 🙂"


async def test_the_sdk_does_not_look_at_each_part_of_each_message(bundle, monkeypatch):
    """A request of 1 MB to a module kept everybody for 4.7 s."""
    seen, convert = [], completions.async_maybe_transform

    async def watched(data, kind):
        seen.append(data)
        return await convert(data, kind)

    monkeypatch.setattr(completions, "async_maybe_transform", watched)
    script = Script(lambda body: ["Yes."])
    async with talking(bundle, script) as page:
        assert await ask(page, "hello", 0) == ["Yes."]
    (sent,) = seen
    assert sent["messages"] == [] and not sent.get("tools")
    assert roles(script.requests[0]) == ["system", "user"]


async def test_an_interruption_hangs_up_and_only_what_was_said_is_remembered(bundle):
    long = [f"This is sentence number {i}. " for i in range(200)]
    parts = [part for sentence in long for part in (sentence, 0.05)]
    script = Script(lambda body: parts if len(script.requests) == 2 else ["Yes."])
    async with talking(bundle, script) as page:
        await ask(page, "hello", 0)  # from now on the model is known to think nothing aloud
        await page.heard(0)
        await page.send(Text("count"))
        await page.wait(Speech, where=lambda m: m.utterance == 1)
        await page.send(Interrupt(None))
        await page.wait(Stop, where=lambda m: m.utterance == 1)
        await ask(page, "go on", 2)
    assert script.abandoned == 1
    assert script.requests[2]["messages"][-1] == {"role": "user", "content": "go on"}
    assert "number 40" not in str(script.requests[2]), "it had no time to be said"


async def test_a_question_over_an_answer_follows_what_was_said_of_it(bundle):
    script = Script(lambda body: ["Apples cost 2,50 €. ", "Pears cost 3 €."])
    async with talking(bundle, script) as page:
        await ask(page, "What do apples cost?", 0)  # all is sent, and not heard yet
        await ask(page, "And plums?", 1)
    assert roles(script.requests[1]) == ["system", "user", "assistant", "user"]
    assert script.requests[1]["messages"][2]["content"].startswith("Apples cost 2,50 €.")


@pytest.mark.parametrize("later", [Text("And plums?"), Interrupt(None)])
async def test_of_questions_in_a_row_the_last_is_answered_and_all_are_known(bundle, later):
    script = Script(lambda body: [f"You said {body['messages'][-1]['content']!r}."])
    async with talking(bundle, script) as page:
        await page.send(Text("What do apples cost?"))
        await page.send(later)
        await ask(page, "Well?", 0)
        assert [m.text for m in page.messages(Answer)] == ["You said 'Well?'."]
    said = [m["content"] for m in script.requests[-1]["messages"][1:]]
    between = [later.text] if isinstance(later, Text) else []
    assert said == ["What do apples cost?", *between, "Well?"]


async def test_facts_told_early_outlive_the_budget_in_a_summary(bundle):
    script = Script()

    def answer(body):
        if body.get("stream"):
            return ["OK."]
        (name,) = re.findall(r"called (\w+)", body["messages"][-1]["content"])
        return [f"The visitor's cat is called {name}."]

    script.answer = answer
    budget = 200
    async with talking(bundle, script, memory=Memory(budget)) as page:
        await ask(page, "My cat is called Mila. " + "She likes fish. " * 10, 0)
        for number in range(1, 6):
            await ask(page, "Here is something else entirely. " * 6, number)
            await page.heard(number)  # an interruption drops a summary that is under way
        await ask(page, "What is my cat called?", 6)
    talks = [body["messages"] for body in script.requests if body.get("stream")]
    summaries = [body["messages"] for body in script.requests if not body.get("stream")]
    assert summaries and summaries[0][0] == {"role": "system", "content": PROMPT}
    assert "She likes fish" in str(talks[1]) and "She likes fish" not in str(talks[-1])
    summary = "(What we talked about before, in short: The visitor's cat is called Mila.)"
    assert talks[-1][1] == {"role": "user", "content": summary}
    assert max(len(str(messages[1:])) for messages in talks) < 2 * 4 * budget


async def test_an_answer_does_without_a_summary_that_fails(bundle):
    script = Script(lambda body: ["Yes."] if body.get("stream") else 500)
    async with talking(bundle, script, memory=Memory(200)) as page:
        for number in range(4):
            assert await ask(page, "Here is something else entirely. " * 12, number) == ["Yes."]
    assert any(not body.get("stream") for body in script.requests)


async def test_a_mood_moves_the_brows_smoothly_until_the_answer_ends(bundle, monkeypatch):
    monkeypatch.setattr(emphasis, "HEIGHTS", (0.0, 0.0))  # what stressed syllables add

    def answer(body):
        if roles(body)[-1] == "tool":
            return ["What a surprise!"]
        return [Call("mood", {"name": "surprised"})] if len(body["messages"]) < 3 else ["Well."]

    script = Script(answer)
    async with talking(bundle, script) as page:
        await ask(page, "boo!", 0)
        assert [m.state for m in page.messages(State)][:2] == ["thinking", "speaking"]
        await ask(page, "and now?", 1)
    (function,) = [tool["function"] for tool in script.requests[0]["tools"]]
    assert function["name"] == "mood" and function["parameters"]["required"] == ["name"]
    assert function["parameters"]["properties"]["name"]["enum"] == list(FACES)
    surprised, neutral = brow_rows(page, 0), brow_rows(page, 1)
    raised, rows = FACES["surprised"]["browInnerUp"], round(EASE * 25)
    assert neutral.max() < 0.2 and surprised[0] < 0.2
    assert surprised[rows:].min() >= raised
    assert np.abs(np.diff(surprised)).max() < 1.6 * raised / rows


def brow_rows(page, utterance):
    rows = [m.expressions for m in page.messages(Speech) if m.utterance == utterance]
    inner = SPEECH_SIZE + EYE_NAMES.index("browInnerUp")
    return np.concatenate(rows).astype(np.float32)[:, inner]


async def test_a_called_gesture_is_the_next_that_the_body_makes(person):
    name, place = "gesture-2", 6 / 15
    talk = " ".join(["This goes on and on for quite a while."] * 3)
    script = Script(lambda body: [Call("gesture", {"name": name}), talk])
    async with talking(person, script) as page:
        page.player = FollowingPlayer()
        await ask(page, "show me", 0)
        points = [point for m in page.messages(Timeline) for point in m.points]
    assert np.array(points)[:, 1].max() == pytest.approx(place, abs=1e-3)
    assert len(script.requests) == 1, "all was said with the gesture: nothing to add"


async def test_a_gesture_without_words_is_followed_by_the_answer(person):
    def answer(body):
        return ["Here."] if roles(body)[-1] == "tool" else [Call("gesture", {"name": "wave"})]

    script = Script(answer)
    async with talking(person, script) as page:
        assert await ask(page, "wave", 0) == ["Here."]
    assert "no such gesture, only gesture-1" in script.requests[1]["messages"][-1]["content"]


async def test_a_server_that_knows_no_functions_is_asked_without(bundle):
    script = Script(lambda body: 400 if "tools" in body else ["Yes."])
    async with talking(bundle, script) as page:
        assert await ask(page, "hi", 0) == ["Yes."]
        assert await ask(page, "hi", 1) == ["Yes."]
    assert ["tools" in body for body in script.requests] == [True, False, False]


async def test_a_server_that_cannot_read_one_function_is_asked_without(bundle):
    """As llama.cpp, which makes a grammar of parameters, whose words these are."""
    script = Script(lambda body: 400 if "tools" in body else ["Yes."])
    script.refusal = "JSON schema conversion failed: Unrecognized schema: {}"
    async with talking(bundle, script) as page:
        assert await ask(page, "hi", 0) == ["Yes."]
    assert ["tools" in body for body in script.requests] == [True, False]


async def test_what_is_refused_without_functions_too_keeps_them(bundle):
    script = Script(lambda body: 400 if len(script.requests) <= 2 else ["Yes."])
    script.refusal = "busy"
    async with talking(bundle, script) as page:
        assert await ask(page, "hi", 0) != ["Yes."]
        assert await ask(page, "hi", 1) == ["Yes."]
    assert ["tools" in body for body in script.requests] == [True, False, True]


async def test_a_model_that_only_calls_functions_is_made_to_speak(bundle):
    mood = Call("mood", {"name": "happy"})
    script = Script(lambda body: [mood] if "tools" in body else ["At last."])
    async with talking(bundle, script) as page:
        assert await ask(page, "hi", 0) == ["At last."]
        assert await ask(page, "hi", 1) == ["At last."]
    offered = ["tools" in body for body in script.requests]
    assert offered == 2 * [*[True] * MOST_ROUNDS, False], "each turn anew"


async def test_halves_of_characters_in_a_call_silence_nobody(bundle):
    mood = Call("mood", {"name": "\ud83d"})
    script = Script(lambda body: [mood] if len(script.requests) == 1 else ["Well."])
    async with talking(bundle, script) as page:
        assert await ask(page, "hi", 0) == ["Well."]
        assert await ask(page, "hi", 1) == ["Well."]


async def test_a_model_that_calls_what_it_was_not_offered_is_not_obeyed(bundle):
    script = Script(lambda body: [Call("mood", {"name": "happy"})])
    async with talking(bundle, script) as page:
        assert (await ask(page, "hi", 0))[0].startswith("Sorry")
    offered = ["tools" in body for body in script.requests]
    assert offered == [*[True] * MOST_ROUNDS, False]


async def test_a_users_tool_is_called_and_its_answer_spoken(bundle):
    tools, asked = FastAPI(), []

    @tools.get("/weather/{city}")
    async def weather(city: str, day: str):
        asked.append((city, day))
        return {"degrees": 21}

    def answer(body):
        if roles(body)[-1] == "tool":
            degrees = json.loads(body["messages"][-1]["content"])["body"]["degrees"]
            return [f"It has {degrees} degrees."]
        return ["One moment. ", Call("weather", {"city": "São Paulo", "day": "today"})]

    script = Script(answer)
    schema = {"properties": {"city": {"type": "string"}, "day": {}}, "required": ["city"]}
    async with running(tools) as port:
        url = f"http://127.0.0.1:{port}/weather/{{city}}"
        tool = Tool("weather", "Temperature in a city.", url, parameters=schema)
        allow = (f"127.0.0.1:{port}",)
        async with talking(bundle, script, tools=(tool,), allow=allow) as page:
            await page.send(Text("how warm is it?"))
            await page.wait(End, where=lambda m: m.utterance == 1)
    assert [m.text for m in page.messages(Answer)] == ["One moment.", "It has 21 degrees."]
    assert asked == [("São Paulo", "today")]
    offered = [t["function"]["name"] for t in script.requests[0]["tools"]]
    assert offered == ["weather", "mood"]


async def test_the_server_of_this_machine_is_the_best(monkeypatch):
    script = Script(models=("nomic-embed-text", "tiny"))
    async with running(script.app()) as port:
        monkeypatch.setattr(local, "PORTS", (1, port))
        monkeypatch.setattr(local, "QUICK", 5.0)  # this machine may be busy
        service = await asyncio.to_thread(chosen, PROVIDERS, Choice(), "language")
        assert service.provider is PROVIDERS["local"]
        described = await asyncio.to_thread(service.described)
        assert described.name == "a server on this machine (tiny)" and not described.stand_in
        made = await asyncio.to_thread(service.make, Context(ADA, None, None))
        assert made._settings.model == "tiny"
    assert "start Ollama" in local.hindrance(local.Settings())
    with pytest.raises(SettingsError, match="no OpenAI-compatible server"):
        service.make(Context(ADA, None, None))


async def test_what_is_no_language_model_is_not_taken_for_one(monkeypatch):
    app = FastAPI()

    async def for_ever():
        while True:
            yield b" "
            await asyncio.sleep(0.01)

    app.get("/slow/models")(lambda: StreamingResponse(for_ever()))
    app.get("/elsewhere/models")(lambda: RedirectResponse("/other"))
    app.get("/list/models")(lambda: [1, 2])
    app.get("/odd/models")(lambda: {"data": [{"id": 3}, 4, {"id": "whisper-large-v3"}]})
    app.get("/deep/models")(lambda: Response("[" * 100_000))
    async with running(app) as port:
        places = ("slow", "elsewhere", "list", "odd", "deep", "no")
        urls = [f"http://127.0.0.1:{port}/{x}" for x in places]
        began = asyncio.get_running_loop().time()
        assert await asyncio.to_thread(first_server, urls, 0.25) is None
        assert asyncio.get_running_loop().time() - began < 5  # of one that never ends


def test_a_server_whose_answer_drips_is_not_waited_for():
    with dripping(b"HTTP/1.1 200 OK\r\nX-Long: ") as port:
        asked = threading.Thread(
            target=language_models, args=(f"http://127.0.0.1:{port}/v1", "none", 0.25), daemon=True
        )
        asked.start()
        asked.join(5)
        assert not asked.is_alive()


def test_a_paid_cloud_is_never_the_default(monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "secret")
    monkeypatch.setattr(local, "PORTS", (1,))
    assert choose(ChatSettings()).language.provider is not PROVIDERS["openai"]


def test_a_missing_key_or_server_is_one_sentence(monkeypatch):
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    with pytest.raises(SettingsError, match="OPENAI_API_KEY"):
        openai.make(openai.Settings(), Context(ADA, None, None))
    with pytest.raises(SettingsError, match="offers no model"):
        openai.make(openai.Settings("http://127.0.0.1:1/v1"), Context(ADA, None, None))
