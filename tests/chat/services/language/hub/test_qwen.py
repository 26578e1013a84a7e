"""A real Qwen2, tiny: in this process through transformers' own API, and in one of its own."""

import asyncio
import subprocess
import sys
import time
from pathlib import Path

import pytest
from pipecat.frames.frames import LLMContextFrame, LLMTextFrame
from pipecat.processors.aggregators.llm_context import LLMContext

from ico3d.bundle.persona import Persona
from ico3d.chat.remote.headless import run
from ico3d.chat.services import choose, chosen
from ico3d.chat.services.language import PROVIDERS
from ico3d.chat.services.language.hub import qwen
from ico3d.chat.services.language.servers import language_models
from ico3d.chat.services.provider import Context
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire.protocol import Answer, End, Interrupt, Speech, Stop, Text
from ico3d.errors import MissingModelError
from ico3d.measure.talking.page import open_page
from support.chat.serving import BROWSER, free_port, serving
from support.needs import needs

pytestmark = [needs("transformers"), pytest.mark.slow]
CONTEXT = Context(Persona("Ada"), None, None)
STARTING = 300  # s that it may take on a busy machine: it imports torch


def settings_of(folder, **options):
    return ChatSettings(BROWSER, Choice("qwen", {"model": str(folder), **options}))


async def test_it_answers_aloud_and_is_loaded_once_for_all(bundle, folder):
    from ico3d.chat.services.language.hub.in_process import load

    async with serving(bundle, settings_of(folder)) as (url, _):
        page, welcome = await open_page(url, microphone=False)
        assert welcome.services.language.name == f"a model in this process ({folder.name})"
        assert not welcome.services.language.stand_in
        await page.heard(0)
        await page.send(Text("who are you?"))
        await page.heard(1)
        said = [m.text for m in page.messages(Answer) if m.utterance == 1]
        assert said == ["My name is Ada.", "Nice to meet you, dear visitor!"]
        await page.close()
    assert load(folder) is load(folder)


async def test_an_interruption_stops_the_generation(bundle, endless):
    from ico3d.chat.services.language.hub.in_process import load

    model = load(endless).model
    async with serving(bundle, settings_of(endless, max_tokens=3000)) as (url, _):
        page, _ = await open_page(url, microphone=False)
        await page.heard(0)
        made = counted(model)
        await page.send(Text("count"))
        await page.wait(Speech, where=lambda m: m.utterance == 1)
        await page.send(Interrupt(None))
        await page.wait(Stop, where=lambda m: m.utterance == 1)
        then = 0
        while then != len(made):  # on a busy machine, what is under way takes a while
            then = len(made)
            await asyncio.sleep(3.0)
        await asyncio.sleep(0.5)
        assert 0 < then < 3000 and len(made) == then
        await page.close()


class Letters:
    """A tokenizer whose tokens are letters."""

    def encode(self, text, add_special_tokens):
        assert not add_special_tokens
        return list(text)

    def decode(self, tokens):
        return "".join(tokens)


def test_what_a_model_reads_is_counted_in_tokens():
    """Nobody can stop it while it reads."""
    from ico3d.chat.services.language.hub.in_process import (
        LONGEST_MESSAGE,
        MOST_TALK,
        MOST_TOLD,
        Loaded,
    )

    talk = [{"role": role, "content": letter * 2000} for role, letter in TALK]
    told = {"role": "system", "content": "!" * 500_000}
    kept = Loaded(Path("x"), None, Letters(), None, False)._fitting([told, *talk])
    assert [(one["role"], one["content"][0], len(one["content"])) for one in kept] == [
        ("system", "!", MOST_TOLD),
        *((role, letter, LONGEST_MESSAGE) for role, letter in TALK[-3:]),
    ]
    assert MOST_TALK == 4 * LONGEST_MESSAGE  # the answer before these has no question before it
    short = [told | {"content": "Be kind."}, *({"role": r, "content": c} for r, c in TALK)]
    assert Loaded(Path("x"), None, Letters(), None, False)._fitting(short) == short


TALK = [("user", "a"), ("assistant", "b"), ("user", "c"), ("assistant", "d"), ("user", "e")]


def counted(model):
    """Grows by one with each token that a model makes."""
    made = []
    model.register_forward_hook(lambda *_: made.append(time.monotonic()))
    return made


async def test_tokens_stream_and_stop_when_nobody_reads_on(endless):
    from ico3d.chat.services.language.hub.in_process import load

    loaded = load(endless)
    stream = loaded.stream([{"role": "user", "content": "count"}], 2000)
    first = [await anext(stream) for _ in range(4)]
    assert "".join(first).replace(" ", "").startswith("one,two;")
    made = counted(loaded.model)
    await stream.aclose()
    await asyncio.sleep(0.2)
    then = len(made)
    await asyncio.sleep(0.3)
    assert len(made) == then < 2000


async def test_summaries_are_inferred_beside_the_conversation(folder, answer):
    made = choose(settings_of(folder)).language.make(CONTEXT)
    context = LLMContext([{"role": "user", "content": "Conversation history: …"}])
    assert await made.run_inference(context, 100, "Summarise.") == answer
    assert await made.run_inference(context, 3, "Summarise.") != answer


def test_a_failed_generation_ends_its_stream(folder):
    from ico3d.chat.services.language.hub.in_process import load

    async def broken():
        async for _ in load(folder).stream([{"role": "user"}], 10):  # no content
            pass

    with pytest.raises(Exception, match="content"):
        asyncio.run(asyncio.wait_for(broken(), 30))


def test_it_is_the_best_only_where_its_weights_are(folder, tmp_path, monkeypatch):
    import huggingface_hub.constants

    monkeypatch.setattr(huggingface_hub.constants, "HF_HUB_CACHE", str(tmp_path / "hub"))
    assert qwen.hindrance(qwen.Settings(str(folder))) == ""
    assert "weights" in qwen.hindrance(qwen.Settings())
    (tmp_path / "config.json").write_text("{}")
    assert qwen.hindrance(qwen.Settings(str(tmp_path))), "a configuration is no model"
    with pytest.raises(MissingModelError, match="ico3d weights fetch qwen2`"):
        choose(ChatSettings(language=Choice("qwen"))).language.make(CONTEXT)
    own = tmp_path / "own"
    own.mkdir()
    (own / "Qwen2-0.5B-Instruct").symlink_to(folder)
    with monkeypatch.context() as patched:
        patched.setenv("ICO3D_MODELS", str(own))
        assert qwen.hindrance(qwen.Settings()) == ""
    assert "weights" in qwen.hindrance(qwen.Settings())
    kept = tmp_path / "hub" / "models--Qwen--Qwen2-0.5B-Instruct"
    (kept / "snapshots").mkdir(parents=True)
    (kept / "refs").mkdir()
    (kept / "refs" / "main").write_text("abc")
    (kept / "snapshots" / "abc").symlink_to(folder)
    assert qwen.hindrance(qwen.Settings()) == ""
    only = {name: PROVIDERS[name] for name in ("qwen", "persona-notes")}
    assert chosen(only, Choice(), "language").provider.title == "a model in this process"


async def test_its_thoughts_are_not_said(thinker, answer):
    from ico3d.chat.services.language.hub.in_process import load

    folder, opened = thinker
    assert load(folder).opens is opened
    made = choose(settings_of(folder)).language.make(CONTEXT)
    asked = LLMContextFrame(LLMContext([{"role": "user", "content": "who are you?"}]))
    said = [frame.text async for frame in run(made, [asked], 60) if isinstance(frame, LLMTextFrame)]
    assert "".join(said).strip() == answer


@pytest.fixture(scope="module")
def served_model(folder, tmp_path_factory):
    """The URL of a real `transformers serve` and its model's name."""
    from transformers.utils.import_utils import is_serve_available

    if not is_serve_available():
        pytest.skip("needs pip install 'transformers[serving]'")
    port = free_port()
    program = str(Path(sys.executable).with_name("transformers"))
    command = [program, "serve", str(folder), "--host", "127.0.0.1", "--port", str(port)]
    log = tmp_path_factory.mktemp("served") / "transformers.log"
    with log.open("wb") as file:
        process = subprocess.Popen([*command, "--device", "cpu"], stdout=file, stderr=file)
    url = f"http://127.0.0.1:{port}/v1"
    try:
        until = time.monotonic() + STARTING
        while not _answers(url):
            assert process.poll() is None and time.monotonic() < until, log.read_text()
            time.sleep(0.2)
        yield url, str(folder)
    finally:
        process.terminate()
        process.wait(20)


def _answers(url):
    import httpx

    try:
        health = url.removesuffix("/v1") + "/health"
        return httpx.get(health, verify=False).status_code == 200  # reads no certificates
    except httpx.HTTPError:
        return False


@pytest.mark.real_time  # the server is a process
async def test_our_pipeline_talks_with_transformers_serve(bundle, served_model):
    url, model = served_model
    settings = ChatSettings(BROWSER, Choice("openai", {"url": url, "model": model}))
    async with serving(bundle, settings) as (page_url, _):
        page, _ = await open_page(page_url, microphone=False)
        await page.wait(End)  # the greeting's, whose place a question at once would take
        for utterance in (1, 2):
            await page.send(Text("who are you?"))
            await page.wait(End, where=lambda m, n=utterance: m.utterance == n)
        said = [m.text for m in page.messages(Answer) if m.utterance == 2]
        await page.close()
    offered = await asyncio.to_thread(language_models, url, "none", 5.0)
    print(f"transformers serve said: {said}; it offers {offered}")
    assert said == ["My name is Ada.", "Nice to meet you, dear visitor!"]
