"""Whisper: a real model file through faster-whisper and pipecat, with random weights."""

import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from ico3d.chat.services.recognition import PROVIDERS, whisper
from ico3d.chat.services.recognition.segments import BLANK
from ico3d.chat.services.recognition.whisper import Settings, find, hindrance, make
from ico3d.errors import MissingModelError, SettingsError
from support.chat.listening import NOBODY, listen, noise
from support.needs import needs

pytestmark = [needs("faster_whisper"), needs("transformers"), needs("torch"), pytest.mark.slow]

SENTENCE = "Wie heißt du? 你好 1,5 %"


@pytest.fixture(scope="session")
def german(tmp_path_factory):
    from support.chat.tiny_whisper import write_whisper

    return write_whisper(tmp_path_factory.mktemp("german"), SENTENCE, "de")


@pytest.fixture(scope="session")
def random(tmp_path_factory):
    from support.chat.tiny_whisper import write_whisper

    return write_whisper(tmp_path_factory.mktemp("random"))


@pytest.fixture
def models(tmp_path, monkeypatch):
    """An empty folder of weights and nothing else on this machine."""
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setattr(whisper, "cuda_devices", lambda: 0)
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_CACHE", str(tmp_path / "hub"))
    return tmp_path


async def test_every_script_comes_through(german):
    service = make(Settings(model=str(german)), NOBODY)
    frames, errors = await listen(service, noise(), noise(2.0))
    assert not errors
    assert [(frame.text, frame.finalized) for frame in frames] == [
        (SENTENCE, False),  # the other one is still to come
        (SENTENCE, True),
    ]


async def test_the_sound_reaches_the_model_as_it_is(random):
    pcm = noise()
    service = make(Settings(model=str(random), language="en"), NOBODY)
    listener, heard = service._model, []

    class Watched:
        def transcribe(self, audio, **options):
            heard.append(audio)
            return listener.transcribe(audio, **options)

    service._model = Watched()
    (frame,), _ = await listen(service, pcm)
    np.testing.assert_array_equal(heard[0][: len(pcm)], pcm.astype(np.float32) / 32768)
    expected, _ = listener.transcribe(heard[0], language="en")
    sure = [segment.text for segment in expected if segment.no_speech_prob < 0.4]
    assert frame.text == (" ".join(sure).strip() or BLANK)


def test_the_model_is_shared_by_sessions(german):
    services = [make(Settings(model=str(german)), NOBODY) for _ in range(2)]
    assert services[0]._shared is services[1]._shared
    assert services[0]._shared.model.device == "cpu"
    assert services[0]._shared.model.compute_type.startswith("int8")


def test_it_speaks_the_language_that_is_set(german):
    assert make(Settings(str(german), language="yue"), NOBODY)._settings.language == "yue"
    assert make(Settings(str(german)), NOBODY)._settings.language is None
    with pytest.raises(SettingsError, match="does not know the language 'xx'"):
        make(Settings(str(german), language="xx"), NOBODY)


def install(folder, name, source):
    """Puts a model where fetched weights lie."""
    (folder / name).symlink_to(source)


def test_without_weights_it_says_what_to_do(models):
    assert hindrance(Settings()) == (
        "the weights of Whisper base are not here: ico3d weights fetch whisper-base (145 MB, MIT)."
    )
    assert "ico3d weights fetch distil-large-v3 (" in hindrance(Settings("distil-large-v3"))
    assert "unknown, use auto or large-v3" in hindrance(Settings("huge"))
    with pytest.raises(MissingModelError, match="fetch whisper-large-v3"):
        make(Settings("large-v3"), NOBODY)


def test_the_best_model_that_keeps_up_is_taken(models, german, monkeypatch):
    install(models, "faster-whisper-large-v3", german)
    assert hindrance(Settings()), "a CPU would not keep up"
    assert hindrance(Settings("large-v3")) == ""
    install(models, "faster-whisper-tiny", german)
    assert find(Settings()).name == "faster-whisper-tiny"
    install(models, "faster-whisper-base", german)
    assert find(Settings()).name == "faster-whisper-base"
    assert PROVIDERS["whisper"].hindrance(Settings()) == ""
    monkeypatch.setattr(whisper, "cuda_devices", lambda: 1)
    assert find(Settings()).name == "faster-whisper-large-v3"
    assert find(Settings(device="cpu")).name == "faster-whisper-base"
    install(models, "faster-distil-whisper-large-v3", german)
    assert find(Settings(language="en")).name == "faster-distil-whisper-large-v3"
    assert find(Settings(language="de")).name == "faster-whisper-large-v3"


def test_an_incomplete_model_is_not_completed_by_a_download(models, german):
    folder = models / "faster-whisper-base"
    folder.mkdir()
    (folder / "model.bin").symlink_to(german / "model.bin")
    assert "has no tokenizer.json" in hindrance(Settings())


def test_a_device_that_is_not_there_is_one_sentence(german):
    settings = Settings(str(german), precision="int4")
    with pytest.raises(SettingsError, match="cannot be used on cpu with int4") as error:
        make(settings, NOBODY)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("filled", "encoded"), [(0, 1000), (250, 1000), (850, 1050), (2900, 3000), (3000, 3000)]
)
def test_a_window_is_as_long_as_needed_and_its_filling_is_silence(filled, encoded):
    from ico3d.chat.services.recognition.short_whisper import shortened

    window = np.zeros((80, 3000), np.float32)  # as faster-whisper fills windows
    window[:, :filled] = np.random.default_rng(0).uniform(-0.8, 1.2, (80, filled))
    given = window.copy()
    found = shortened(window)
    assert found.shape == (80, encoded)
    np.testing.assert_array_equal(found[:, :filled], given[:, :filled])
    assert (found[:, filled:] == given[:, :filled].min(initial=0.0)).all()
    np.testing.assert_array_equal(window, given)
    np.testing.assert_array_equal(shortened(window[None])[0], found)


@pytest.mark.parametrize(
    ("text", "twice"),
    [
        ("So I said, so I said, well.", True),
        ("It's fine. It's fine.", False),
        ("one two three four one two three", False),
        ("Thank you, all of you. thank you all of you", True),
        ("a" + "'" * 400 + "b", False),  # a pattern took longer than anybody lives
        ("a' " * 500, True),
        (" ".join(map(str, range(500))), False),
    ],
)
def test_what_is_said_twice_is_found_at_once(text, twice):
    from ico3d.chat.services.recognition.short_whisper import repeats_itself

    begun = time.process_time()
    assert repeats_itself(text) is twice
    assert time.process_time() - begun < 1


def test_a_core_is_left_to_others(german, monkeypatch):
    seen = {}

    class Watched:
        def __init__(self, folder, device, **options):
            seen.update(options)

    monkeypatch.setattr("ico3d.chat.services.recognition.short_whisper.ShortWhisper", Watched)
    for cores, threads in ((1, 1), (2, 1), (4, 3), (64, 4), (None, 1)):
        monkeypatch.setattr(whisper.os, "cpu_count", lambda cores=cores: cores)
        whisper.load.__wrapped__(german, "cpu", "int8")
        assert seen["cpu_threads"] == threads


@pytest.mark.parametrize("model", ["auto", "tiny.en"])
def test_a_folder_of_a_models_name_is_none(models, random, monkeypatch, model):
    """A server may be started in a folder of strangers."""
    monkeypatch.chdir(models)
    shutil.copytree(random, models / model)
    with pytest.raises(MissingModelError, match="ico3d weights fetch whisper-"):
        whisper.find(Settings(model=model))
    assert whisper.find(Settings(model=f"./{model}")) == Path(model)
