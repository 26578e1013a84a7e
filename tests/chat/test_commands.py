"""`ico3d serve`: what it asks of visitors, and when it says that it is there."""

import asyncio
import re
import types
from urllib.parse import parse_qs, urlsplit

import pytest
from loguru import logger

from ico3d.chat import parts
from ico3d.chat.services.language import openai
from ico3d.chat.serving import server
from ico3d.cli import main
from support.chat.serving import TYPED, free_port

SETTINGS = 'recognition = "browser"\nlanguage = "persona-notes"\nvoice = "espeak-ng"\n'


@pytest.fixture
def served(monkeypatch, bundle_path, tmp_path):
    """Runs the command up to where it would serve; returns the exit status and the guard."""
    file, guards = tmp_path / "chat.toml", []

    def make_server(guard, certificate, *_):
        guards.append(guard)
        return types.SimpleNamespace(run=lambda sockets: [listener.close() for listener in sockets])

    monkeypatch.setattr(server, "make_server", make_server)

    def serve(*words, more=""):
        file.write_text(SETTINGS + more)
        command = ["serve", str(bundle_path), "--port", "0", "--settings", str(file)]
        return main([*command, *words]), guards[-1] if guards else None

    return serve


def key_in(text):
    found = re.search(r"#key=([a-z2-7-]{19})", text)
    return found and found[1]


def test_whoever_comes_by_a_name_shows_a_key(served, capsys):
    status, guard = served("--name", "talk.example")
    told = capsys.readouterr().out
    assert status == 0 and guard._sites.is_key(key_in(told))
    assert "who has the key gets in" in told


def test_nobody_else_shows_one(served, capsys):
    for words in ([], ["--name", "talk.example", "--open"]):
        _, guard = served(*words)
        assert not guard._sites.asks_for_tokens
        assert key_in(capsys.readouterr().out) is None


def test_the_operators_own_key_is_not_printed(served, capsys, monkeypatch):
    monkeypatch.setenv("ADA_KEY", "sixteen letters.")
    own = '[embedding]\nkey_variable = "ADA_KEY"\n'
    status, guard = served("--name", "talk.example", more=own)
    told = capsys.readouterr()
    assert status == 0 and guard._sites.is_key("sixteen letters.")
    assert "sixteen" not in told.out + told.err and key_in(told.out) is None
    assert served("--name", "talk.example", "--open", more=own)[0] == 1
    assert "leave out one of them" in capsys.readouterr().err


def test_other_machines_are_let_in_by_https_or_a_proxy_only(served, capsys):
    assert served("--host", "0.0.0.0")[0] == 1
    told = capsys.readouterr()
    assert told.out == "" and "must not travel unencrypted" in told.err


def test_the_operators_browser_is_let_in_for_some_minutes(served, monkeypatch, capsys):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    _, guard = served("--name", "talk.example", "--browser")
    (address,) = opened
    (token,) = parse_qs(urlsplit(address).query)["token"]
    scope = {"path": "/ws", "query_string": f"token={token}".encode()}
    assert guard._sites.admits(scope, None)
    assert key_in(capsys.readouterr().out) not in address


def test_an_address_is_told_when_all_is_warm(served, monkeypatch, capsys):
    order = []
    monkeypatch.setattr(parts, "warm_up", lambda made: order.append(capsys.readouterr().out))
    served()
    assert order == [""] and "Random is at" in capsys.readouterr().out


def test_a_language_model_that_does_not_warm_up_is_told_of(bundle, monkeypatch):
    lines = []
    number = logger.add(lambda message: lines.append(message.record["message"]), level="WARNING")
    try:
        made = parts.make_parts(server.open_avatar(bundle, TYPED))
        parts.warm_up(made)  # nothing to warm

        class Cold:
            async def warm_up(self):
                await asyncio.sleep(0)
                raise ConnectionRefusedError(111, "my question")

        monkeypatch.setattr(parts, "WarmsUp", Cold)
        parts.warm_up(types.SimpleNamespace(language=Cold()))
    finally:
        logger.remove(number)
    assert lines == ["language did not answer a first question: ConnectionRefusedError (111)"]


def test_visitors_are_told_no_address_of_a_model():
    url = f"http://gpu7.internal:{free_port()}/v1"
    assert openai.detail(openai.Settings(url)) == ""
    assert openai.detail(openai.Settings(url, "qwen3")) == "qwen3"
    assert openai.detail(openai.Settings()) == openai.OWN_MODEL
