"""The bench of the mouth: alignment, reading of lips, figures."""

import json

import numpy as np
import pytest

from ico3d.cli import main
from ico3d.errors import SettingsError
from ico3d.measure import expression as room
from ico3d.measure.alignment import MOST_README, aligned, transcripts
from ico3d.speech.articulation import ARTICULATION, articulation_track
from ico3d.speech.training.corpus import utterance
from support.shared import SPEECH

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def one_round(monkeypatch):
    """Speed is not what is tested here."""
    monkeypatch.setattr(room, "TIMED", 1e-3)


def test_transcripts_come_from_the_readmes_table(tmp_path):
    with pytest.raises(SettingsError, match=r"no README\.md"):
        transcripts(tmp_path)
    readme = tmp_path / "README.md"
    readme.write_text("Nothing | here\n")
    with pytest.raises(SettingsError, match="no table with a column 'words'"):
        transcripts(tmp_path)
    readme.write_text(
        "| file | s | words |\n|---|---|---|\n| a.wav | 1 | Ask not. |\n| b.wav | 2 | x |"
    )
    with pytest.raises(SettingsError, match="none of the files"):
        transcripts(tmp_path)
    (tmp_path / "a.wav").touch()
    assert transcripts(tmp_path) == {tmp_path / "a.wav": "Ask not."}
    table = readme.read_text()
    readme.write_text(table + "|\n" * (MOST_README // 2))  # a list of cells for each two bytes
    with pytest.raises(SettingsError, match=r"no README\.md"):  # none that is read whole
        transcripts(tmp_path)


def test_words_that_nobody_knows_cannot_be_aligned():
    pytest.importorskip("pocketsphinx")
    with pytest.raises(SettingsError, match="cannot be found in the sound: xyzzyx"):
        aligned(np.zeros(16000, np.int16), "Xyzzyx!")


def test_alignment_finds_the_pause_between_two_words():
    pytest.importorskip("pocketsphinx")
    soundfile = pytest.importorskip("soundfile")
    if not SPEECH.is_dir():
        pytest.skip("no recordings of human speech here (../shared/speech)")
    samples, _ = soundfile.read(SPEECH / "jfk_16k.wav", dtype="int16")
    phonemes, end = aligned(samples, transcripts(SPEECH)[SPEECH / "jfk_16k.wav"])
    assert 10 < end <= 11
    times = [phoneme.time for phoneme in phonemes]
    assert times == sorted(times)
    said = [phoneme.symbol for phoneme in phonemes if phoneme.symbol]
    assert " ".join(said[:7]) == "æ n d s oʊ m aɪ"  # And so my


def test_a_reading_finds_what_is_linear_in_what_is_heard(monkeypatch):
    pytest.importorskip("espeakng_loader")
    monkeypatch.setattr(room, "SPOKEN", 6)
    monkeypatch.setattr(room, "recorded", lambda sound, *_: sound)
    mixing = np.random.default_rng(1).normal(size=(len(ARTICULATION), 12))
    known = {}

    def remembered(*arguments, **options):
        sound, phonemes = utterance(*arguments, **options)
        known[sound.tobytes()] = phonemes
        return sound, phonemes

    def hears(samples, rate):
        times = np.arange(76) / 25
        return articulation_track(known[samples.tobytes()], room.SECONDS, times) @ mixing + 3

    monkeypatch.setattr(room, "utterance", remembered)
    read = room.reading(hears)
    sound, phonemes = remembered(np.random.default_rng(5), room.SECONDS, held_out=True)
    truth = articulation_track(phonemes, room.SECONDS, np.arange(76) / 25)
    assert np.corrcoef(read(hears(sound, 16000)), truth[:, 0])[0, 1] > 0.98


def test_the_verb_prints_and_writes_all_figures(tmp_path, monkeypatch, capsys):
    for package in ("pocketsphinx", "espeakng_loader"):
        pytest.importorskip(package)
    soundfile = pytest.importorskip("soundfile")
    if not SPEECH.is_dir():
        pytest.skip("no recordings of human speech here (../shared/speech)")
    name = "new-home-in-the-stars-16k.wav"
    samples, rate = soundfile.read(SPEECH / name, dtype="int16")
    soundfile.write(tmp_path / name, samples, rate)
    (tmp_path / "README.md").write_text((SPEECH / "README.md").read_text("utf-8"), "utf-8")
    monkeypatch.setattr(room, "SPOKEN", 10)
    monkeypatch.setenv("ICO3D_MODELS", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    file = tmp_path / "figures.json"
    assert main(["bench", "expression", "--speech", str(tmp_path), "--json", str(file)]) == 0
    figures = json.loads(file.read_text())
    assert list(figures) == ["avatar", "builtin", "ave (random)"]
    for found in figures.values():
        assert found["real_time_factor"] > 1
        assert found["streaming_difference"] < 1e-5
        assert max(found["silence_opening"].values()) < 1e-3
    assert figures["builtin"]["lip_correlation"][name] > 0.6
    assert figures["avatar"]["lip_correlation"][name] > 0.5
    assert abs(figures["builtin"]["lip_lag_ms"][name]) < 80
    assert figures["ave (random)"]["lip_correlation"] is None
    assert "ave (random)" in capsys.readouterr().out
