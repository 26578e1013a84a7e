"""Voices of this machine: espeak-ng, and Kokoro and Piper with random weights."""

import json
import time

import numpy as np
import pytest

from ico3d.bundle.persona import Persona
from ico3d.chat.services import chosen
from ico3d.chat.services.provider import Context
from ico3d.chat.services.voice import PROVIDERS, espeak, kokoro, piper
from ico3d.chat.services.voice.base import STARVED
from ico3d.chat.services.voice.portions import MOST
from ico3d.chat.settings.conversation import Choice
from ico3d.chat.wire.protocol import SPEECH_RATE
from ico3d.common.espeak.speech import synthesize
from ico3d.errors import MissingModelError, SettingsError

onnx = pytest.importorskip("onnx")


def context(*languages):
    return Context(Persona("Ann", languages=languages), None, None)


@pytest.mark.parametrize(
    ("text", "voice", "used"),
    [
        ("Hello", "en-us+f3", "en-us+f3"),
        ("Grüße", "de+f3", "de+f3"),
        ("你们好吗，Bob", "en-us+f3", "cmn+f3"),
        ("你好", "yue", "yue"),
        ("今日は天気", "en-us", "ja"),
        ("مرحبا", "en-us+m1", "ar+m1"),
        ("سلام", "fa", "fa"),
        ("Привет", "en-us", "ru"),
        ("Привіт", "uk+f2", "uk+f2"),
        ("नमस्ते", "en-us", "hi"),
        ("안녕", "en-us", "ko"),
        ("3.5", "de", "de"),
        ("", "de", "de"),
    ],
)
def test_espeak_speaks_a_script_in_its_language(text, voice, used):
    assert espeak.voice_for(text, voice) == used


@pytest.mark.parametrize("languages", espeak.SCRIPTS.values())
def test_espeak_has_those_languages(languages):
    for language in languages.split():
        synthesize("a", language)  # raises if there is none


@pytest.mark.parametrize("voice", ["sub/x", "../x", "..", ""])
def test_a_piper_voice_is_no_path(voice, tmp_path, monkeypatch):
    for place in (tmp_path / "models" / "sub", tmp_path):
        place.mkdir(parents=True, exist_ok=True)
        for name in ("x.onnx", "x.onnx.json"):
            (place / name).touch()
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path / "models"))
    for named in (voice, str(tmp_path / "x")):
        with pytest.raises(MissingModelError):
            piper.find_voice(piper.Settings(voice=named))


@pytest.mark.parametrize(
    ("languages", "own", "voice"),
    [
        ((), "", "en-us+f3"),
        (("de-AT", "en"), "", "de+f3"),
        (("zh",), "", "cmn+f3"),
        (("de",), "fr+m1", "fr+m1"),
    ],
)
def test_espeak_speaks_the_personas_language(languages, own, voice):
    made = espeak.make(espeak.Settings(own), context(*languages))
    assert made._settings.voice == voice


async def test_espeak_speaks_what_models_write(say):
    voice = espeak.make(espeak.Settings(), context())
    for text in ("Hello, 3.5 m.", "你好，我是小明。", "Grüße, 10:30 Uhr!", "print('x')"):
        pcm, errors = await say(voice, text)
        assert not errors and len(pcm) > SPEECH_RATE / 3 and np.abs(pcm).max() > 3000
        voice = espeak.make(espeak.Settings(), context())


async def test_a_text_that_cannot_be_spoken_is_an_error_and_not_the_end(say):
    voice = espeak.make(espeak.Settings(), context())
    speak = voice._speak

    def sometimes(text):
        if "bad" in text:
            raise ValueError("no such word")
        return speak(text)

    voice._speak = sometimes
    began = time.monotonic()
    pcm, errors = await say(voice, "bad", "good")
    assert errors[0] == "a sentence could not be spoken: no such word" and len(pcm) > 3000
    assert time.monotonic() - began < STARVED / 2  # nobody waited for what does not come


def graph(nodes, inputs, output, constants):
    """An ONNX model in memory."""
    tensors = [onnx.numpy_helper.from_array(value, name) for name, value in constants.items()]
    made = onnx.helper.make_graph(nodes, "voice", inputs, [output], tensors)
    opset = [onnx.helper.make_opsetid("", 17)]
    return onnx.helper.make_model(made, opset_imports=opset, ir_version=9)


def value(name, kind, *shape):
    return onnx.helper.make_tensor_value_info(name, getattr(onnx.TensorProto, kind), shape)


node = onnx.helper.make_node


@pytest.fixture
def kokoro_files(models):
    """Kokoro's inputs and outputs with random weights, and two voices."""
    rng = np.random.default_rng(0)
    model = graph(
        [
            node("Cast", ["tokens"], ["floats"], to=onnx.TensorProto.FLOAT),
            node("Unsqueeze", ["floats", "two"], ["column"]),
            node("MatMul", ["column", "weights"], ["waves"]),
            node("Sin", ["waves"], ["sines"]),
            node("ReduceMean", ["style"], ["level"], keepdims=0),
            node("Mul", ["sines", "level"], ["levelled"]),
            node("Div", ["levelled", "speed"], ["sped"]),
            node("Reshape", ["sped", "flat"], ["audio"]),
        ],
        [
            value("tokens", "INT64", 1, "n"),
            value("style", "FLOAT", 1, 256),
            value("speed", "FLOAT", 1),
        ],
        value("audio", "FLOAT", "samples"),
        {
            "two": np.array([2]),
            "flat": np.array([-1]),
            "weights": rng.normal(size=(1, 600)).astype(np.float32),
        },
    )
    onnx.save(model, models / "kokoro-v1.0.onnx")
    styles = {name: np.full((510, 1, 256), 0.5, np.float32) for name in ("af_heart", "zf_xiaobei")}
    with (models / "voices-v1.0.bin").open("wb") as file:
        np.savez(file, **styles)
    return models


async def test_kokoro_speaks(say, kokoro_files):
    pytest.importorskip("kokoro_onnx")
    assert kokoro.hindrance(kokoro.Settings()) == ""
    pcm, errors = await say(kokoro.make(kokoro.Settings(), None), "Hello there.")
    assert not errors and len(pcm) > 600 * 5 and 8000 < np.abs(pcm).max() <= 16384
    pcm, errors = await say(kokoro.make(kokoro.Settings("zf_xiaobei"), None), "你好。")
    assert not errors and len(pcm) > 600 * 2
    voices = [kokoro.make(kokoro.Settings(), None) for _ in range(2)]
    assert voices[0]._kokoro is voices[1]._kokoro


def test_kokoro_says_what_is_missing(models):
    pytest.importorskip("kokoro_onnx")
    missing = kokoro.hindrance(kokoro.Settings())
    wanted = "the weights 'kokoro' are not here: fetch them with ico3d weights fetch kokoro "
    assert missing.startswith(wanted)
    with pytest.raises(MissingModelError) as error:
        kokoro.make(kokoro.Settings(), None)
    assert str(error.value) == missing
    with pytest.raises(SettingsError, match="speed must be"):
        kokoro.Settings(speed=3)


def test_kokoro_has_no_such_voice(kokoro_files):
    pytest.importorskip("kokoro_onnx")
    with pytest.raises(SettingsError, match="voice must be af_heart or zf_xiaobei"):
        kokoro.make(kokoro.Settings("no_body"), None)


PIPER_RATE = 22050
TONE = 0.125  # radians per sample
PER_PHONEME = 1000  # samples


@pytest.fixture
def piper_files(models):
    """Piper's inputs, output and description; whatever it says is one pure tone."""
    model = graph(
        [
            node("Cast", ["input"], ["floats"], to=onnx.TensorProto.FLOAT),
            node("Unsqueeze", ["floats", "two"], ["column"]),
            node("MatMul", ["column", "zeros"], ["none"]),
            node("Reshape", ["none", "flat"], ["line"]),
            node("Add", ["line", "step"], ["steps"]),
            node("CumSum", ["steps", "axis"], ["phase"], exclusive=1),
            node("Sin", ["phase"], ["output"]),
        ],
        [
            value("input", "INT64", 1, "n"),
            value("input_lengths", "INT64", 1),
            value("scales", "FLOAT", 3),
        ],
        value("output", "FLOAT", 1, 1, 1, "samples"),
        {
            "two": np.array([2]),
            "flat": np.array([1, 1, 1, -1]),
            "axis": np.array(3),
            "zeros": np.zeros((1, PER_PHONEME), np.float32),
            "step": np.float32(TONE),
        },
    )
    onnx.save(model, models / "en_US-tone-low.onnx")
    symbols = "_^$ .,!?abcdefghijklmnopqrstuvwxyzæðŋɐɑɔəɛɜɡɪɹɾʃʊʌʒθᵻˈˌː"
    description = {
        "audio": {"sample_rate": PIPER_RATE},
        "espeak": {"voice": "en-us"},
        "phoneme_type": "espeak",
        "num_symbols": 256,
        "num_speakers": 1,
        "inference": {"noise_scale": 0.667, "length_scale": 1, "noise_w": 0.8},
        "phoneme_id_map": {symbol: [number] for number, symbol in enumerate(symbols)},
    }
    (models / "en_US-tone-low.onnx.json").write_text(json.dumps(description))
    return models


async def test_piper_is_resampled_without_a_click_or_a_loss(say, piper_files):
    pytest.importorskip("piper")
    settings = piper.Settings("en_US-tone-low")
    assert piper.hindrance(settings) == ""
    one, errors = await say(piper.make(settings, None), "Hello there.")
    assert not errors
    seconds = len(one) / SPEECH_RATE
    samples = round(seconds * PIPER_RATE / PER_PHONEME) * PER_PHONEME
    assert len(one) == pytest.approx(samples * SPEECH_RATE / PIPER_RATE, abs=2)  # to the last
    ideal = np.sin(TONE * PIPER_RATE / SPEECH_RATE * np.arange(len(one)))
    level = np.abs(one).max()
    np.testing.assert_allclose(one[100:-100] / level, ideal[100:-100], atol=0.02)
    two, _ = await say(piper.make(settings, None), "Hello there.", "Hello there.")
    np.testing.assert_allclose(two, np.concatenate([one, one]), atol=3)  # no trace of the other


async def test_piper_speaks_a_long_text_portion_by_portion(say, piper_files, monkeypatch):
    pytest.importorskip("piper")
    spoken = []
    monkeypatch.setattr(piper, "of_piper", lambda _, text: spoken.append(text) or [list("abc")])
    piper.engine.cache_clear()
    text = "\ufdfa" * 100 + " and a word " * 60  # the former is read as eighteen letters
    pcm, errors = await say(piper.make(piper.Settings("en_US-tone-low"), None), text)
    piper.engine.cache_clear()
    assert not errors and len(pcm) > 1000
    assert max(map(len, spoken)) <= MOST and "".join(spoken).split() == text.split()
    assert max(one.count("\ufdfa") for one in spoken) == MOST // 18


def test_piper_says_what_is_missing(piper_files):
    pytest.importorskip("piper")
    missing = (
        "the Piper voice 'en_US-ljspeech-high' is not here: fetch it with python -m "
        f"piper.download_voices --download-dir {piper_files} en_US-ljspeech-high."
    )
    assert piper.hindrance(piper.Settings()) == missing
    with pytest.raises(MissingModelError) as error:
        piper.make(piper.Settings(), None)
    assert str(error.value) == missing
    (piper_files / "en_US-tone-low.onnx.json").write_text('{"phoneme_type": "pinyin"}')
    with pytest.raises(SettingsError, match="use kokoro or openvoice"):
        piper.make(piper.Settings("en_US-tone-low"), None)


def test_the_best_voice_is_one_that_is_here():
    assert chosen(PROVIDERS, Choice(), "voice").provider.title == "espeak-ng"


def test_a_better_voice_is_taken_where_it_is_here(kokoro_files):
    pytest.importorskip("kokoro_onnx")
    assert chosen(PROVIDERS, Choice(), "voice").provider.title == "Kokoro"
