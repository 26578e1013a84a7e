"""What a model thinks is never spoken, and is a sign of life while it thinks."""

import asyncio
import contextlib
import itertools
import re
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pipecat.frames.frames import LLMContextFrame, LLMTextFrame
from pipecat.processors.aggregators.llm_context import LLMContext

from ico3d.bundle.persona import Persona
from ico3d.chat.remote.headless import run
from ico3d.chat.services import choose
from ico3d.chat.services.language import PROVIDERS, local, openai
from ico3d.chat.services.language.reasoning import Parts, Thoughts
from ico3d.chat.services.provider import Context
from ico3d.chat.settings.conversation import ChatSettings, Choice, Patience
from ico3d.chat.supervision.apologies import APOLOGIES
from ico3d.chat.wire.protocol import Answer, End, State, Text
from ico3d.errors import SettingsError
from ico3d.measure.talking.page import open_page
from support.chat.remote import service_app
from support.chat.remote import serving as serving_app
from support.chat.scripted_server import Script, Thought, running
from support.chat.serving import BROWSER, serving, visiting

pytestmark = pytest.mark.slow

ADA = Persona("Ada")
CONTEXT = Context(ADA, None, None)
SORRY = APOLOGIES["en"]["language"].split(". ")[0] + "."
HMM, SAID = "Hmm, the visitor wants to know my name. I must not tell this.", "I am Ada."
MARKS = [
    *(f"<{name}>|</{name}>" for name in ("think", "thinking", "thought", "reasoning", "THINK")),
    *('<think time="3">|</think>', "[THINK]|[/THINK]", "◁think▷|◁/think▷"),
    *("<|begin_of_thought|>|<|end_of_thought|>", "<|START_THINKING|>|<|END_THINKING|>"),
    "<|channel|>analysis<|message|>|<|end|><|start|>assistant<|channel|>final<|message|>",
]
FORMS = {
    "tags": [f"<think>\n{HMM}\n</think>\n\n{SAID}"],
    "torn tags": ["<th", "ink", ">", HMM, "<", "/thi", "nk", ">\n", "\nI am", " Ada."],
    "only closed": [HMM, "</think>\n\n", SAID],
    "only closed, torn": [HMM[:20], HMM[20:], "</thi", "nk>", SAID],
    "nested": [f"<think>{HMM}<think>{HMM}</think>{HMM}</think>{SAID}"],
    "twice": [f"<think>{HMM}</think>I am <think>{HMM}</think>Ada."],
    "other name": [f"<thinking>{HMM}</thinking>{SAID}"],
    "reasoning_content": [Thought(HMM), Thought(HMM), SAID],
    "reasoning": [Thought(HMM, "reasoning"), SAID],
    "field and tags": [Thought(HMM), f"<think>{HMM}</think>{SAID}"],
}


def settings_for(port, patience=None, **options):
    options = {"url": f"http://127.0.0.1:{port}/v1", "model": "tiny", **options}
    return ChatSettings(BROWSER, Choice("openai", options), patience=patience or Patience())


@contextlib.asynccontextmanager
async def talking(bundle, app, patience=None, **options):
    """Yields the page of a visitor whom nobody greets."""
    async with contextlib.AsyncExitStack() as stack:
        port = await stack.enter_async_context(running(app))
        chosen = settings_for(port, patience, **options)
        url, _ = await stack.enter_async_context(serving(bundle, chosen, persona=ADA))
        page, _ = await open_page(url, microphone=False)
        yield page
        await page.close()


async def ask(page, utterance, text="who are you?"):
    """The sentences of an answer, when all of it has been made."""
    await page.send(Text(text))
    await page.wait(End, where=lambda m: m.utterance == utterance)
    return [m.text for m in page.messages(Answer) if m.utterance == utterance]


@pytest.mark.parametrize("form", FORMS)
async def test_only_the_answer_is_spoken_and_remembered(bundle, form):
    script = Script(lambda body: FORMS[form])
    async with talking(bundle, script.app()) as page:
        assert await ask(page, 0) == [SAID]
        await page.heard(0)
        assert await ask(page, 1) == [SAID]
    assert script.requests[1]["messages"][-2] == {"role": "assistant", "content": SAID}


@pytest.mark.parametrize("form", ["plain", "only closed", "tags", "reasoning"])
async def test_a_warm_model_is_heard_while_it_answers(bundle, form):
    """The first answer need not be whole before it is given out."""
    forms = FORMS | {"plain": ["Hello."]}
    answers = iter([forms[form], [*forms[form], " And", 1.5, " you?"]])
    script = Script(lambda body: next(answers))
    async with running(script.app()) as port:
        asked = openai.Settings(f"http://127.0.0.1:{port}/v1", "tiny")
        await openai.make(asked, CONTEXT).warm_up()
        async with serving(bundle, settings_for(port), persona=ADA) as (url, _):
            page, _ = await open_page(url, microphone=False)
            await page.send(Text("who are you?"))
            first, _ = await page.wait(Answer, where=lambda m: m.utterance == 0)
            last, _ = await page.wait(End, where=lambda m: m.utterance == 0)
            assert last - first > 1.0
            await page.close()
    assert len(script.requests) == 2
    assert script.requests[0]["messages"][-1]["role"] == "user"


SPOKEN = {
    "thoughts about the tag": ["<think>They ask about <think> tags.</think>Those mark thoughts."],
    "an element": ["Those mark thoughts.", " Give a <reason>late</reason> element."],
    "an analysis": ["Those mark thoughts.", " The <analysis> element has a child."],
}


@pytest.mark.parametrize("form", SPOKEN)
def test_an_answer_may_speak_of_such_tags(form):
    text = "".join(SPOKEN[form])
    said = "Those mark thoughts." if "thoughts about" in form else text
    for size in (1, 7, len(text)):
        thoughts, parts = Thoughts(), Parts()
        for at in range(0, len(text), size):
            parts += thoughts.push(text[at : at + size])
        assert (parts + thoughts.finish()).said == said
    cut = Thoughts()
    cut.push(SPOKEN["thoughts about the tag"][0][:-10])
    assert cut.finish(complete=False).said == ""  # nobody knows how it would have gone on


async def test_one_answer_with_a_lone_tag_changes_nothing_for_those_after(bundle):
    answers = iter(
        [["Hello."], ["Write </think> at its end."], ["I am Ada.", " And", 1.5, " you?"]]
    )
    async with talking(bundle, Script(lambda body: next(answers)).app()) as page:
        await ask(page, 0)
        await ask(page, 1)
        await page.send(Text("who are you?"))
        first, _ = await page.wait(Answer, where=lambda m: m.utterance == 2)
        last, _ = await page.wait(End, where=lambda m: m.utterance == 2)
        assert last - first > 1.0


@pytest.mark.parametrize("parts", [["<think>", HMM], [Thought(HMM)], [HMM, "</think>"]])
async def test_thoughts_without_an_answer_are_apologised_for(bundle, parts):
    async with talking(bundle, Script(lambda body: parts).app()) as page:
        assert (await ask(page, 0))[0] == SORRY


THINKING = {
    "tags": ["<think>", *("so ", 0.3) * 8, "</think>", SAID],
    "only closed": [*("so ", 0.3) * 8, "</think>", SAID],
    "field": [*(Thought("so "), 0.3) * 8, SAID],
}


@pytest.mark.parametrize("form", THINKING)
@pytest.mark.parametrize("remote", [False, True])
async def test_thinking_aloud_is_a_sign_of_life_and_the_page_shows_it(bundle, form, remote):
    patience = Patience(language=1.5)
    app = Script(lambda body: THINKING[form]).app()
    async with contextlib.AsyncExitStack() as stack:
        if remote:  # our own module stands between
            port = await stack.enter_async_context(running(app))
            asked = openai.Settings(f"http://127.0.0.1:{port}/v1", "tiny")
            app = service_app("language", lambda: openai.make(asked, CONTEXT))
        page = await stack.enter_async_context(talking(bundle, app, patience))
        began = asyncio.get_running_loop().time()
        assert await ask(page, 0) == [SAID]
        assert asyncio.get_running_loop().time() - began > patience.language
        assert [m.state for m in page.messages(State)][:2] == ["thinking", "speaking"]


async def test_thinking_has_an_end(bundle):
    endless = [part for _ in range(200) for part in (Thought("so "), 0.1)]
    script = Script(lambda body: endless)
    async with talking(bundle, script.app(), Patience(language=1.0, reasoning=2.0)) as page:
        began = asyncio.get_running_loop().time()
        assert (await ask(page, 0))[0] == SORRY
        assert 1.9 < asyncio.get_running_loop().time() - began < 10
    assert script.abandoned == 1


async def test_a_plain_model_speaks_while_it_writes_from_its_second_answer_on(bundle):
    slow = [SAID, " ", *("And on. ", 0.2) * 20]
    script = Script(lambda body: slow if len(script.requests) > 1 else [SAID])
    async with talking(bundle, script.app()) as page:
        await ask(page, 0)
        await page.heard(0)
        since = len(page.log)
        await page.send(Text("and now?"))
        await page.wait(Answer, since)
        assert not [m for m in page.messages(End, since) if m.utterance == 1]


async def test_a_summary_has_no_thoughts_and_its_own_length():
    script = Script(lambda body: [f"<think>{HMM}</think>{SAID}"])
    async with running(script.app()) as port:
        chosen = settings_for(port, max_tokens=5, temperature=0.5)
        made = await asyncio.to_thread(choose(chosen).language.make, CONTEXT)
        context = LLMContext([{"role": "user", "content": "hi"}])
        assert await made.run_inference(context, max_tokens=300) == SAID
    (body,) = script.requests
    assert body["max_completion_tokens"] == 300 and "max_tokens" not in body


async def test_a_module_gives_thoughts_apart():
    script = Script(lambda body: [f"<think>{HMM}</think>", SAID])
    async with running(script.app()) as port:
        asked = openai.Settings(f"http://127.0.0.1:{port}/v1", "tiny")
        app = service_app("language", lambda: openai.make(asked, CONTEXT))
        async with serving_app(app) as url, visiting(url) as plain:
            body = {"messages": [{"role": "user", "content": "hi"}]}
            answer = await plain.post("/v1/chat/completions", json=body)
    message = answer.json()["choices"][0]["message"]
    assert message["content"] == SAID and message["reasoning_content"].strip() == HMM


@pytest.mark.parametrize("use", ["openai", "local"])
async def test_requests_say_what_the_settings_say(use, monkeypatch):
    script = Script(lambda body: [SAID])
    wanted = {"temperature": 0.3, "max_tokens": 70}
    extra = {"top_k": 20, "chat_template_kwargs": {"enable_thinking": False}}
    async with running(script.app()) as port:
        monkeypatch.setattr(local, "PORTS", (port,))
        monkeypatch.setattr(local, "PATIENT", 10.0)
        options = {"model": "tiny", **wanted, "extra": extra}
        if use == "openai":
            options["url"] = f"http://127.0.0.1:{port}/v1"
        service = choose(ChatSettings(language=Choice(use, options))).language
        made = await asyncio.to_thread(service.make, CONTEXT)
        asked = LLMContextFrame(LLMContext([{"role": "user", "content": "hi"}]))
        said = [frame async for frame in run(made, [asked], 20)]
    assert [frame.text for frame in said if isinstance(frame, LLMTextFrame)] == [SAID]
    (body,) = script.requests
    assert {name: body[name] for name in (*wanted, *extra)} == {**wanted, **extra}


@pytest.mark.parametrize("use", ["openai", "local"])
@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"temperature": 2.5}, "temperature must be 0 to 2"),
        ({"temperature": float("nan")}, "temperature must be 0 to 2"),
        ({"temperature": "hot"}, "'temperature' must be a number"),
        ({"max_tokens": 0}, "max_tokens must be at least 1"),
        ({"max_tokens": 1.5}, "'max_tokens' must be a whole number"),
        ({"extra": {"messages": []}}, "extra must not have messages: ico3d sets that"),
        ({"extra": {"top_p": float("inf")}}, "extra cannot be sent as JSON"),
        ({"extra": 3}, "'extra' must be a table"),
    ],
)
def test_what_makes_no_sense_in_a_request_is_one_sentence(use, options, sentence):
    with pytest.raises(SettingsError, match=sentence):
        choose(ChatSettings(language=Choice(use, options)))


def test_openais_own_models_know_another_name_of_the_longest_answer():
    assert openai.sampling(openai.Settings(max_tokens=9)) == {"max_completion_tokens": 9}
    assert PROVIDERS["openai"].settings is openai.Settings


CLEAN = st.text(st.characters(exclude_characters="<>[]◁▷|", exclude_categories=["Cs"]), max_size=20)


def streamed(text, cuts, opened):
    """What is said of a text that comes in pieces."""
    from ico3d.chat.services.language.reasoning import Thoughts

    thoughts, edges = Thoughts(opened), sorted({0, len(text), *(c % (len(text) + 1) for c in cuts)})
    pieces = [text[a:b] for a, b in itertools.pairwise(edges)]
    return "".join(thoughts.push(piece).said for piece in pieces) + thoughts.finish().said


@given(
    mark=st.sampled_from(MARKS),
    thought=CLEAN,
    said=CLEAN,
    cuts=st.lists(st.integers(0, 400), max_size=30),
    opened=st.sampled_from([False, None]),
)
def test_wherever_a_stream_is_cut_only_the_answer_is_said(mark, thought, said, cuts, opened):
    begin, end = mark.split("|", 1) if mark.count("|") == 1 else marks_of(mark)
    assert streamed(begin + thought + end + said, cuts, opened) == said.lstrip()
    assert streamed(begin + thought, cuts, opened) == ""
    if "channel" not in mark:
        assert streamed(thought + end + said, cuts, None) == said.lstrip()
        assert streamed(thought + end + said, cuts, True) == said.lstrip()


def marks_of(mark):
    """Both halves of marks that have bars of their own."""
    middle = mark.index(">|<") + 1
    return mark[:middle], mark[middle + 1 :]


IN_MARKS = re.compile(
    "think|thought|reason|reflection|analysis|pad|monologue|channel|end|start|return", re.I
)
"""Each mark has one of these words, and generated texts may hold words of this project."""


@given(
    text=st.text(max_size=80).filter(lambda text: IN_MARKS.search(text) is None),
    cuts=st.lists(st.integers(0, 100), max_size=20),
)
def test_a_text_without_marks_is_said_as_it_is(text, cuts):
    assert streamed("A" + text, cuts, False) == "A" + text
    assert streamed("A" + text, cuts, None) == "A" + text


@pytest.mark.parametrize("opened", [None, False])
def test_thoughts_in_pieces_take_time_in_proportion_to_their_length(opened):
    """Each piece copied all before it: one answer stopped the server for two minutes."""
    thoughts = Thoughts(opened)
    thoughts.push("" if opened is None else "<think><think></think>")
    begun = time.process_time()
    for _ in range(4000):
        thoughts.push("🙂" + "a" * 1000)
    assert time.process_time() - begun < 2.0
