"""Whole talks with a language model that says what a test wants."""

import contextlib

from ico3d.bundle.persona import Persona
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.chat.wire.protocol import Answer, End, Text
from ico3d.measure.talking.page import open_page
from support.chat.scripted_server import running
from support.chat.serving import BROWSER, serving

ADA = Persona("Ada")


def settings_for(port, **others):
    options = {"url": f"http://127.0.0.1:{port}/v1", "model": "tiny"}
    return ChatSettings(BROWSER, Choice("openai", options), **others)


@contextlib.asynccontextmanager
async def talking(bundle, script, **others):
    """Yields the page of a visitor whom nobody greets."""
    async with contextlib.AsyncExitStack() as stack:
        port = await stack.enter_async_context(running(script.app()))
        served = serving(bundle, settings_for(port, **others), persona=ADA)
        url, _ = await stack.enter_async_context(served)
        page, _ = await open_page(url, microphone=False)
        yield page
        await page.close()


async def ask(page, text, utterance):
    """Asks, waits for all sound of the answer, returns its sentences."""
    await page.send(Text(text))
    await page.wait(End, where=lambda m: m.utterance == utterance)
    return [m.text for m in page.messages(Answer) if m.utterance == utterance]


def roles(body):
    return [message["role"] for message in body["messages"]]
