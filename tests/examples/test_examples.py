"""The programs of examples/, as they stand there, on tiny data."""

import re
import runpy
import sys
import threading
import time
import wave
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import bundle_path
from ico3d.chat.serving import server
from ico3d.chat.settings.conversation import ChatSettings, Choice
from ico3d.head.model_folder import TrainedHead
from support.needs import skip_without

pytestmark = pytest.mark.slow
EXAMPLES = Path(__file__).parents[2] / "examples"
MOST_LINES = 60
OFFLINE = ChatSettings(
    recognition=Choice("pocketsphinx"),
    language=Choice("persona-notes"),
    voice=Choice("espeak-ng"),
)


def run(monkeypatch, example, *words):
    """Runs an example in this process, as `python examples/…` does."""
    monkeypatch.setattr(sys, "argv", [example, *map(str, words)])
    runpy.run_path(str(EXAMPLES / example), run_name="__main__")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """What the first example writes."""
    skip_without("anny")  # of which the synthetic person is made
    out = tmp_path_factory.mktemp("example")
    size = ["--frames", "22", "--size", "48", "--steps", "20", "--gaussians", "400"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ico3d.studio.picture.paint.DIRECTIONS", 6)  # drawn sooner
        run(patch, "01_train_a_head.py", "--out", out, *size)
    return out


@pytest.fixture(scope="module")
def url():
    """A server with the packaged avatar, in a thread."""
    bundle = Bundle.open(bundle_path("demo"))
    listener = server.bind("127.0.0.1", 0)
    avatar = server.open_avatar(bundle, OFFLINE)
    running = server.make_server(server.make_app(bundle, avatar, "127.0.0.1"))
    thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]})
    thread.start()
    while not running.started:
        time.sleep(0.01)
    yield server.address(listener)
    running.should_exit = True
    thread.join()


def test_every_example_is_short_and_listed():
    files = sorted(EXAMPLES.glob("*.py"))
    assert [file.name[:3] for file in files] == [f"{n:02}_" for n in range(1, len(files) + 1)]
    listed = re.findall(r"\((\d\d_\w+\.py)\)", (EXAMPLES / "README.md").read_text("utf-8"))
    assert listed == [file.name for file in files]
    for file in files:
        lines = len(file.read_text("utf-8").splitlines())
        assert lines <= MOST_LINES, f"{file.name} has {lines} lines"


def test_a_head_is_trained(trained):
    head = TrainedHead.load(trained / "head")
    assert head.inputs == "speech" and 50 <= len(head.model) <= 400


def test_a_bundle_is_rendered(monkeypatch, tmp_path):
    out = tmp_path / "demo.png"
    run(monkeypatch, "02_render_an_avatar.py", "--avatar", "demo", "--size", "64", "--out", out)
    picture = np.asarray(Image.open(out))
    assert picture.shape == (64, 64, 3)
    assert (picture[0, 0] > 250).all(), "nobody stands in the corner"
    assert picture[24:40, 24:40].mean() < 240, "somebody stands in the middle"


def test_a_trained_head_is_rendered(monkeypatch, tmp_path, trained):
    out, folders = tmp_path / "head.png", (trained / "head", trained / "capture")
    words = ["--avatar", folders[0], "--capture", folders[1], "--out", out]
    run(monkeypatch, "02_render_an_avatar.py", *words)
    picture = np.asarray(Image.open(out))
    assert picture.shape == (48, 48, 3)
    assert picture[16:32, 16:32].mean() < 240, "somebody stands in the middle"


def test_the_avatar_in_a_pipeline(monkeypatch, tmp_path):
    out = tmp_path / "said.npz"
    run(monkeypatch, "03_avatar_in_pipecat.py", "--text", "Mama and papa.", "--out", out)
    said = np.load(out)
    sound, face = said["sound"], said["face"]
    assert len(sound) == 960 * len(face) and len(face) > 15
    loud = np.abs(sound.astype(float)).reshape(len(face), -1).mean(1) > 500  # (T,)
    mouth = np.linalg.norm(face[:, :32] - face[-1, :32], axis=1)  # (T,)
    assert mouth[loud].mean() > 2 * mouth[-3:].mean(), "the mouth moves while it sounds"


def test_a_script_asks(monkeypatch, tmp_path, url):
    words = ["--question", "Who are you?", "--out", tmp_path / "answer", "--url", url]
    run(monkeypatch, "04_talk_from_a_script.py", *words)
    with wave.open(str(tmp_path / "answer.wav")) as file:
        seconds = file.getnframes() / file.getframerate()
        loudest = np.abs(np.frombuffer(file.readframes(file.getnframes()), np.int16)).max()
    assert seconds > 1 and loudest > 1000
    captions = (tmp_path / "answer.txt").read_text("utf-8").splitlines()
    times = [float(line.split()[0]) for line in captions]
    assert times[0] == 0 and times == sorted(times) and times[-1] < seconds
    greeting = Bundle.open(bundle_path("demo")).manifest.persona.greeting
    assert greeting not in " ".join(captions)
