"""Phonemes for Piper and Kokoro: with scripted packages, and with the real ones where they are."""

import json
import textwrap

import pytest

from ico3d.common.espeak import phonemes
from ico3d.common.espeak.phonemes import MOST, of_kokoro, of_piper
from ico3d.errors import ServiceError

PIPER = """
    import os
    from pathlib import Path

    with Path(__file__).with_name("starts").open("a") as starts:
        starts.write(".")

    class PiperConfig:
        @classmethod
        def from_dict(cls, values):
            print("what a library prints spoils no answer")
            return values["espeak"]["voice"]

    class PiperVoice:
        def __init__(self, session, config):
            self.voice = config

        def phonemize(self, text):
            if "break" in text:
                os.abort()
            if "odd" in text:
                raise ValueError("an odd text")
            return [[self.voice, *text]]
"""
KOKORO = """
    class Tokenizer:
        def phonemize(self, text, language):
            return f"{language}:{text}"
"""
ENDING = ["i." * 97, "A.\u2029" * 300, "z.B. " * 150, ".s.s.s.s.s.s.s " * 14]
"""Texts at which espeak-ng of piper-tts 1.8.0 ends its process."""


@pytest.fixture(autouse=True)
def anew():
    """A process that imports what the test offers, and none afterwards."""
    phonemes.process.close()
    yield
    phonemes.process.close()


@pytest.fixture
def scripted(tmp_path, monkeypatch):
    """Packages that stand for Piper and Kokoro; gives the description of a voice."""
    (tmp_path / "piper.py").write_text(textwrap.dedent(PIPER))
    (tmp_path / "kokoro_onnx").mkdir()
    (tmp_path / "kokoro_onnx" / "__init__.py").touch()
    (tmp_path / "kokoro_onnx" / "tokenizer.py").write_text(textwrap.dedent(KOKORO))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return described(tmp_path)


def described(folder):
    path = folder / "voice.onnx.json"
    values = {"espeak": {"voice": "en-us"}, "phoneme_type": "espeak", "phoneme_id_map": {}}
    values |= {"audio": {"sample_rate": 22050}, "num_symbols": 256, "num_speakers": 1}
    path.write_text(json.dumps(values | {"inference": {}}))
    return path


def test_both_voices_ask_another_process(scripted):
    assert of_piper(scripted, "hi") == [["en-us", "h", "i"]]
    assert of_kokoro("hi", "fr-fr") == "fr-fr:hi"


@pytest.mark.parametrize(
    ("text", "lengths"),
    [
        ("a" * (MOST - 1), [MOST]),
        ("a" * MOST, [MOST, 1]),
        ("word " * 100, [246, 250, 5]),
        ("b" * 150 + " " + "c" * 100, [152, 100]),
    ],
)
def test_no_sentence_of_piper_has_thousands_of_phonemes(text, lengths, scripted):
    pieces = of_piper(scripted, text)  # the scripted one has a phoneme more than letters
    assert [len(piece) for piece in pieces] == lengths
    assert [phoneme for piece in pieces for phoneme in piece] == ["en-us", *text]


def test_a_text_that_breaks_the_library_is_an_error_and_the_next_one_is_spoken(scripted):
    with pytest.raises(ServiceError, match="espeak-ng failed at a text"):
        of_piper(scripted, "break it")
    assert of_piper(scripted, "a") == [["en-us", "a"]]


def test_many_texts_that_break_the_library_start_it_no_second_time(scripted):
    for _ in range(5):
        with pytest.raises(ServiceError):
            of_piper(scripted, "break it")
    assert scripted.with_name("starts").read_text() == "."


def test_what_the_voice_says_of_a_text_is_told(scripted):
    with pytest.raises(ServiceError, match=r"no phonemes for a text: an odd text\."):
        of_piper(scripted, "odd")


@pytest.mark.parametrize("text", ENDING)
def test_texts_that_end_piper_end_nothing_else(text, tmp_path):
    pytest.importorskip("piper")
    description = described(tmp_path)
    try:
        of_piper(description, text)  # some versions can speak it
    except ServiceError as error:
        assert "failed at a text" in str(error)
    assert "".join(of_piper(description, "Hello.")[0]) == "həlˈoʊ."


@pytest.mark.parametrize("text", ["1777 " * 40, "≤ " * 100, "WWWWWWW " * 25])
def test_few_letters_that_are_read_as_many_words_are_pieces(text, tmp_path):
    pytest.importorskip("piper")
    pieces = of_piper(described(tmp_path), text)
    assert len(pieces) > 4 and max(map(len, pieces)) <= MOST


@pytest.mark.parametrize("text", ["i." * 400, "A.\u2029" * 300])
def test_texts_that_end_kokoro_end_nothing_else(text):
    pytest.importorskip("kokoro_onnx")
    try:
        of_kokoro(text, "en-us")
    except ServiceError as error:
        assert "failed at a text" in str(error)
    assert of_kokoro("Hello.", "en-us") == "həlˈoʊ."
