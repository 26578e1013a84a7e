"""The guides of the conversation: their files are read, their commands run as they stand there.

Servers are started in this process, visited once, and ended. What needs weights, a GPU or another
machine is not run: its words are parsed and its settings are read.
"""

import json
import os
import shlex
import shutil
import subprocess
import threading
import time
import urllib.request
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import soundfile

from guides import guide
from guides.small import SMALL
from ico3d.bundle.persona import read_persona
from ico3d.chat.services import TABLES, choose
from ico3d.chat.services.language.notes import Notes
from ico3d.chat.services.voice.openvoice import permitted
from ico3d.chat.serving import server
from ico3d.chat.serving.guard import is_own
from ico3d.chat.settings.conversation import read_settings
from ico3d.cli import main
from ico3d.common.espeak.speech import synthesize
from ico3d.common.weights import weights_named
from ico3d.errors import BundleError, SettingsError

pytestmark = pytest.mark.slow

STAND_INS = 'recognition = "pocketsphinx"\nlanguage = "persona-notes"\nvoice = "espeak-ng"\n'
OUTSIDE = """
import os, sys
def told(event, values):
    address = {"socket.connect": values[1:], "socket.getaddrinfo": (values,)}.get(event)
    if not address or not isinstance(address[0], tuple):
        return  # something else, or a socket of the file system
    host = str(address[0][0])
    if host not in ("127.0.0.1", "localhost", "::1", "0.0.0.0", "None"):
        with open(os.environ["OUTSIDE"], "a") as file:
            print(event, host, file=file)
sys.addaudithook(told)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A machine with nothing on it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("MODULE_KEY", "sesame")
    for name in ("ICO3D_MODELS", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def visited(monkeypatch, capsys):
    """What stands in for commands that serve: they serve here until they were seen once.

    Gives a function and the list of what they printed; `visited.small` goes behind their words.
    """

    def described(avatar):
        """Guides choose services that are not on every machine: they are named and not made."""
        return SimpleNamespace(services=avatar.services.described(), language=None)

    monkeypatch.setattr("ico3d.chat.parts.make_parts", described)
    made = server.make_server

    def with_a_visitor(*served):
        running = made(*served)
        threading.Thread(target=_visit, args=(running,), daemon=True).start()
        return running

    def serve(words):
        verb = guide.verb_of(words)
        assert main([*words[1:], *SMALL[verb].split(), *serve.more]) == 0, capsys.readouterr().err
        serve.said.append(capsys.readouterr().out)

    serve.said, serve.more = [], []
    monkeypatch.setattr(server, "make_server", with_a_visitor)
    return serve


def _visit(running):
    """Asks a server that is about to start whether it is well, and ends it."""
    try:
        while not running.started:
            time.sleep(0.01)
        host, port = running.servers[0].sockets[0].getsockname()
        with urllib.request.urlopen(f"http://{host}:{port}/health", timeout=10) as answer:
            assert json.load(answer)["ok"]
    finally:
        running.should_exit = True


def _follow(name, visited, **instead):
    verbs = ("serve", "serve-module", "demo")
    known = {"weights fetch": _fetches, "bake": guide.parsed}
    guide.follow(name, SMALL, {verb: visited for verb in verbs} | known | instead)


def _fetches(words):
    """`ico3d weights fetch` without its network."""
    names = guide.parsed(words).names
    assert names and all(weights_named(name) for name in names)


def _chosen(file):
    """What the real reader makes of a settings file."""
    return choose(read_settings(Path(file)))


def test_own_persona(visited):
    assert guide.write_files("own-persona.md") == ["ada.toml", "museum.toml"]
    _follow("own-persona.md", visited)
    assert [said.split()[0] for said in visited.said] == ["Ada", "Ada"]
    settings = read_settings(Path("museum.toml"))
    assert settings.memory.tokens == 2000 and not settings.gestures
    assert [tool.name for tool in settings.tools] == ["opening_hours"]
    _says_what_the_guide_says(Notes(read_persona(Path("ada.toml"))))


def _says_what_the_guide_says(notes):
    text = (guide.GUIDES / "own-persona.md").read_text("utf-8")
    rows = text.split("| you | Ada")[1].split("\n\n")[0].splitlines()[2:]
    assert len(rows) == 3
    for row in rows:
        asked, answer = (cell.strip() for cell in row.split("|")[1:3])
        assert notes.answer(asked).startswith(answer.removesuffix("…").strip())


@pytest.mark.parametrize("name", ["own-persona.md", "own-voice.md"])
def test_the_personas_have_voices_that_are_there(name):
    guide.write_files(name)
    voices = read_persona(Path("ada.toml")).voice
    assert voices.keys() <= TABLES["voice"].keys()
    assert len(synthesize("a", voices["espeak-ng"]).samples)


def test_a_persona_that_makes_no_sense_is_the_guides_sentence():
    Path("ada.toml").write_text('name = "Ada"\nlanguages = ["English"]\n')
    with pytest.raises(BundleError) as refused:
        read_persona(Path("ada.toml"))
    assert f"*“{refused.value}”*" in (guide.GUIDES / "own-persona.md").read_text("utf-8")


def test_own_voice(visited):
    voices = ["espeak.toml", "kokoro.toml", "piper.toml", "server.toml", "clone.toml"]
    assert guide.write_files("own-voice.md") == [*voices, "ada.toml"]
    _follow("own-voice.md", visited)
    *pages, module, _ = visited.said
    speaks = [_services(said)[2] for said in pages]
    server = "OpenAI-compatible server"
    assert speaks == ["espeak-ng", "Kokoro", "Piper", server, "OpenVoice V2"]
    assert module.startswith("voice with espeak-ng is at ")
    for line in guide.other_commands("own-voice.md"):
        if line.startswith("ico3d"):
            assert guide.parsed(shlex.split(line, comments=True))


def test_a_voice_is_cloned_with_the_guides_consent_only():
    guide.write_files("own-voice.md")
    soundfile.write("my-voice.wav", np.zeros(16_000), 16_000)
    options = _chosen("clone.toml").voice.options
    with pytest.raises(SettingsError, match="consent"):
        permitted(type(options)(reference="my-voice.wav"))
    recording = permitted(options)
    assert json.loads(recording.kept(".json").read_text())["by"] == "Jane Doe"


def test_gpu_server(visited):
    assert guide.write_files("gpu-server.md") == ["gpu.toml", "talk.toml", "face.toml"]
    Path("stand-ins.toml").write_text(STAND_INS)

    def module(words):
        """With what is here instead of Whisper and Kokoro."""
        visited.more = ["--settings", "stand-ins.toml"]
        visited(words)
        visited.more = []

    _follow("gpu-server.md", visited, **{"serve-module": module, "bench chat": guide.parsed})
    modules = [said.split(" is at ")[0] for said in visited.said if " with " in said[:20]]
    assert modules == [
        "recognition with pocketsphinx",
        "voice with espeak-ng",
        "expression with demo",
    ]
    started = next(said for said in visited.said if "listens" in said)
    assert all(name.startswith("OpenAI-compatible server") for name in _services(started))
    _all_have_the_key(Path("talk.toml"))
    gpu = read_settings(Path("gpu.toml"))
    assert _chosen("gpu.toml") and gpu.recognition.options["device"] == "cuda"
    face = read_settings(Path("face.toml")).expression
    assert face.use == "remote" and face.key_variable == "MODULE_KEY"


def _all_have_the_key(path):
    services = _chosen(path)
    for kind, port in (("recognition", 9001), ("language", 8000), ("voice", 9003)):
        options = getattr(services, kind).options
        assert options.key_variable == "MODULE_KEY"
        assert options.url == f"http://127.0.0.1:{port}/v1"


def test_a_proxy_that_passes_host_and_origin_is_let_in_under_the_servers_names_only():
    name, origin = "talk.example.org", "https://talk.example.org"
    assert is_own(name, origin, name) and is_own(name, origin, "127.0.0.1", [name])
    assert not is_own(name, "https://elsewhere.example.org", "127.0.0.1", [name])
    assert not is_own(name, origin, "127.0.0.1") and not is_own(name, origin, "0.0.0.0")
    assert is_own("127.0.0.1:9001", None, "0.0.0.0") and not is_own(name, None, "0.0.0.0")


def test_all_offline(visited):
    assert guide.write_files("all-offline.md") == ["offline.toml"]
    _follow("all-offline.md", visited)
    assert len(visited.said) == 2
    serving = [_services(said) for said in visited.said]
    assert not any("OpenAI" in name or "browser" in name for names in serving for name in names)
    assert serving[1][::2] == ["Whisper", "Kokoro"]


def _services(said):
    """What listens, thinks and speaks, of what the start of a server printed."""
    verbs = ("listens", "thinks", "speaks")
    lines = [line.split() for line in said.splitlines()]
    return [" ".join(words[2:]) for words in lines if words and words[0] in verbs]


def _networks_can_be_left():
    command = ["unshare", "--map-root-user", "--net", "ip", "link", "set", "lo", "up"]
    tools = all(map(shutil.which, ("unshare", "ip", "ico3d")))
    return tools and subprocess.run(command, capture_output=True).returncode == 0


@pytest.mark.slow
@pytest.mark.skipif(not _networks_can_be_left(), reason="no network can be left here")
def test_a_conversation_asks_nobody_outside(tmp_path):
    """The guide's own check, with one question; and nobody even tries to call another machine."""
    line = next(c for c in guide.other_commands("all-offline.md") if c.startswith("unshare"))
    (tmp_path / "sitecustomize.py").write_text(OUTSIDE)
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    told = tmp_path / "outside.txt"
    done = subprocess.run(
        line.replace("--turns 3", "--turns 1"),
        shell=True,
        env=os.environ | {"PYTHONPATH": paths, "OUTSIDE": str(told)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert not told.exists(), told.read_text()
