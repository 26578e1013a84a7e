"""The verb itself: a process that serves, and what it refuses."""

import os
import signal
import subprocess
import sys
from contextlib import closing

import openai
import pytest

from ico3d.chat.remote.commands import ServeModule
from ico3d.cli import main

OFFLINE = """
recognition = "pocketsphinx"
language = "persona-notes"
voice = "espeak-ng"
"""


@pytest.fixture
def settings(tmp_path):
    path = tmp_path / "offline.toml"
    path.write_text(OFFLINE)
    return path


@pytest.mark.slow
def test_a_module_is_a_process_that_the_sdk_talks_to(bundle_path, settings):
    words = ["serve-module", "voice", "--port", "0", "--key-variable", "SESAME"]
    words += ["--settings", str(settings), "--bundle", str(bundle_path)]
    process = subprocess.Popen(
        [sys.executable, "-m", "ico3d.cli", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"SESAME": "open"},
    )
    with closing(process.stdout), closing(process.stderr):
        line = process.stdout.readline()
        assert line.startswith("voice with espeak-ng is at http://127.0.0.1:")
        with openai.OpenAI(base_url=line.split()[5], api_key="open", max_retries=5) as sdk:
            sound = sdk.audio.speech.create(
                model="any", voice="any", input="Hello.", response_format="pcm"
            )
        assert len(sound.content) > 2 * 24_000 // 4
        os.kill(process.pid, signal.SIGINT)
        assert process.wait(10) in (0, 130, -signal.SIGINT)
        assert "Traceback" not in process.stderr.read()


@pytest.mark.parametrize(
    ("kind", "title"), [("recognition", "pocketsphinx"), ("language", "persona notes")]
)
def test_settings_choose_the_provider(bundle_path, settings, kind, title):
    assert ServeModule(kind, settings, bundle_path)._app("")[0] == title


def test_a_face_without_a_model_and_a_key_that_is_none_are_one_sentence(tmp_path, capsys):
    words = ["serve-module", "expression", "--port", "0"]
    assert main([*words, "--key-variable", "NO_SUCH_KEY"]) == 1
    assert "NO_SUCH_KEY holds no key" in capsys.readouterr().err
    assert main([*words, "--bundle", str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith("ico3d: ")
