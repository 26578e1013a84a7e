"""Sentences for visitors: pages know each of them by its code, in all of their languages."""

import json
import re
from pathlib import Path

import pytest

from ico3d.chat.wire.protocol import Error, Notice
from ico3d.chat.wire.sentences import FULL, IDLE, SENTENCES, STILL_LIPS

TEXTS = Path(__file__).parents[3] / "viewer" / "src" / "words" / "texts.json"


def test_pages_have_the_same_sentences_and_no_others():
    texts = json.loads(TEXTS.read_text())
    own = {key.removeprefix("server."): text for key, text in texts.items() if "server." in key}
    assert {code: text["en"] for code, text in own.items()} == {s.code: s.text for s in SENTENCES}


@pytest.mark.parametrize("sentence", SENTENCES, ids=lambda s: s.code)
def test_numbers_go_into_the_text_and_beside_it(sentence):
    names = re.findall(r"{(\w+)}", sentence.text)
    error = sentence.error(True, **dict.fromkeys(names, 0.5))
    assert error.values == dict.fromkeys(names, 0.5)
    assert "{" not in error.message and error.message.count("0.5") == len(names)


def test_messages_of_sentences():
    assert IDLE.error(True, again=True, minutes=10).message.startswith("Nothing was said for 10 ")
    assert FULL.error(True) == Error(FULL.text, True, False, "full", {})
    assert STILL_LIPS.notice() == Notice("still-lips", STILL_LIPS.text)
