"""Recognisers: speech to text."""

from functools import partial

from ico3d.chat.services.provider import Provider, Table
from ico3d.chat.services.recognition import browser, openai, sphinx, whisper

ON_SERVER: Table = {
    "whisper": Provider("Whisper", whisper.Settings, whisper.make, whisper.hindrance),
    "pocketsphinx": Provider(
        "pocketsphinx", sphinx.Settings, sphinx.make, sphinx.hindrance, stand_in=True
    ),
    # never the best by themselves: they may take what is said out of the house
    "openai": Provider("OpenAI-compatible server", openai.Settings, openai.make, openai.hindrance),
}
"""Recognisers that run on the server or beyond it, and get the visitor's sound."""

PROVIDERS: Table = ON_SERVER | {
    "browser": Provider(
        "the visitor's browser",
        browser.Settings,
        partial(browser.make, ON_SERVER),
        browser.hindrance,
    ),
}
