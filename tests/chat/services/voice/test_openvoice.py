"""OpenVoice V2: its adapter, consent and cache, against a fake of its documented API."""

import importlib
import inspect
import json
import sys
from datetime import UTC, datetime

import numpy as np
import pytest

pytest.importorskip("torch")
soundfile = pytest.importorskip("soundfile")

from ico3d.chat.services.voice import openvoice  # noqa: E402
from ico3d.chat.wire.protocol import SPEECH_RATE  # noqa: E402
from ico3d.errors import MissingModelError, SettingsError  # noqa: E402

LANGUAGES = openvoice.LANGUAGES
CONSENT = {"consent": "I agree that my voice speaks here.", "consent_by": "Änne Müller"}


@pytest.fixture
def reference(tmp_path):
    path = tmp_path / "me.wav"
    soundfile.write(path, np.random.default_rng(1).normal(0, 0.1, 16000), 16000)
    return str(path)


def seconds(text):
    return 0.05 * len(text)


async def test_the_base_speaker_speaks(installed, fake, say):
    settings = openvoice.Settings("EN-BR", speed=2.0)
    assert openvoice.hindrance(settings) == ""
    pcm, errors = await say(openvoice.make(settings, None), "Hello there, you.", "Good bye.")
    assert not errors
    expected = (seconds("Hello there, you.") + seconds("Good bye.")) / 2
    assert len(pcm) == pytest.approx(expected * SPEECH_RATE, abs=3)
    assert np.abs(pcm).max() == pytest.approx(0.5 * 32767, rel=0.02)
    [base] = fake.TTS.made
    assert base.said == [("Hello.", 1), ("Hello there, you.", 1), ("Good bye.", 1)]
    assert not fake.ToneColorConverter.made  # nothing to convert to


@pytest.mark.parametrize("language", LANGUAGES)
async def test_six_languages(installed, fake, say, language):
    settings = openvoice.Settings("EN_INDIA" if language == "EN" else language)
    pcm, errors = await say(openvoice.make(settings, None), LANGUAGES[language][1])
    assert not errors and len(pcm) and fake.TTS.made[0].language == language


async def test_the_voice_becomes_that_of_the_reference(installed, fake, say, reference):
    settings = openvoice.Settings(reference=reference, **CONSENT)
    pcm, errors = await say(openvoice.make(settings, None), "Hello there.")
    assert not errors and len(pcm) == pytest.approx(seconds("Hello there.") * SPEECH_RATE, abs=3)
    [converter] = fake.ToneColorConverter.made
    level = float(converter.extract_se([reference])[0, 0, 0])
    assert np.abs(pcm).max() == pytest.approx(level * 32767, rel=0.02)
    assert fake.HELD in converter.loaded and converter.messages[-1] == "default"


async def test_without_the_watermark(installed, fake, say, reference):
    settings = openvoice.Settings(reference=reference, watermark=False, **CONSENT)
    await say(openvoice.make(settings, None), "Hello.")
    assert fake.ToneColorConverter.made[0].messages == [None, None]


def test_sessions_share_the_models(installed, fake, reference):
    settings = openvoice.Settings(reference=reference, **CONSENT)
    voices = [openvoice.make(settings, None) for _ in range(3)]
    assert len(fake.TTS.made) == len(fake.ToneColorConverter.made) == 1
    assert len({id(voice) for voice in voices}) == 3


def test_a_voice_is_not_cloned_without_consent(installed, fake, reference):
    for given in ({}, {"consent": "yes"}, {"consent_by": "Ann"}, {**CONSENT, "consent": " "}):
        settings = openvoice.Settings(reference=reference, **given)
        with pytest.raises(SettingsError) as refused:
            openvoice.make(settings, None)
        assert str(refused.value) == (
            f"{reference}: cloning a voice needs the consent of its owner: state it in the "
            'settings file under [voice] as consent = "…" and the name as consent_by = "…".'
        )
    assert not fake.TTS.made  # nothing was loaded for it


def test_consent_is_kept_with_the_recording(installed, fake, reference, home, tmp_path):
    openvoice.make(openvoice.Settings(reference=reference, **CONSENT), None)
    [record] = (home / ".cache/ico3d/voices").glob("*.json")
    kept = json.loads(record.read_text(encoding="utf-8"))
    assert kept["statement"] == CONSENT["consent"] and kept["by"] == "Änne Müller"
    assert kept["recording"] == "me.wav" and kept["sha256"] == record.stem
    at = datetime.fromisoformat(kept["at"])
    assert abs((datetime.now(UTC) - at).total_seconds()) < 600

    openvoice.engine.cache_clear()
    again = openvoice.Settings(reference=reference)
    openvoice.make(again, None)  # it has been stated
    assert json.loads(record.read_text(encoding="utf-8")) == kept

    other = tmp_path / "other.wav"
    soundfile.write(other, np.zeros(100), 16000)
    with pytest.raises(SettingsError, match="consent of its owner"):
        openvoice.make(openvoice.Settings(reference=str(other)), None)


def test_an_embedding_is_computed_once(installed, fake, reference, home):
    settings = openvoice.Settings(reference=reference, **CONSENT)

    def extracted():
        openvoice.engine.cache_clear()
        openvoice.make(settings, None)
        return fake.ToneColorConverter.made[-1].extracted

    assert [extracted(), extracted()] == [1, 0]
    [embedding] = (home / ".cache/ico3d/voices").glob("*.safetensors")
    embedding.write_bytes(embedding.read_bytes()[:-7])
    assert [extracted(), extracted()] == [1, 0]  # a damaged one is made again


def test_what_is_missing_is_said(fake, monkeypatch, reference, models):
    fake.install(monkeypatch)
    openvoice.engine.cache_clear()
    missing = openvoice.hindrance(openvoice.Settings())
    assert missing.startswith("the weights 'melotts-english' are not here: fetch them with ico3d ")
    with pytest.raises(MissingModelError) as error:
        openvoice.make(openvoice.Settings(), None)
    assert str(error.value) == missing
    fake.write_weights(models)
    (models / "OpenVoiceV2/converter/checkpoint.pth").unlink()
    assert openvoice.hindrance(openvoice.Settings()) == ""
    settings = openvoice.Settings(reference=reference, **CONSENT)
    assert openvoice.hindrance(settings).startswith("the weights 'openvoice' are not here")
    with pytest.raises(MissingModelError, match="ico3d weights fetch openvoice"):
        openvoice.make(settings, None)
    monkeypatch.setitem(sys.modules, "melo.api", None)
    missing = r"needs the package 'melo.api'.*docs/conversation/voices\.md"
    with pytest.raises(SettingsError, match=missing):
        openvoice.make(openvoice.Settings(), None)


def test_what_is_not_installed_is_said():
    if not is_installed("melo"):
        assert openvoice.hindrance(openvoice.Settings()).startswith("melo is not installed: ")


def test_wrong_settings_are_told(installed):
    with pytest.raises(SettingsError, match="voice must be EN-US or EN-BR or EN_INDIA"):
        openvoice.make(openvoice.Settings("EN-Bob"), None)
    with pytest.raises(SettingsError, match=r"voice must begin with EN or ES or .*not be 'DE'"):
        openvoice.Settings("DE")
    with pytest.raises(SettingsError, match=r"nobody\.wav: cannot be read"):
        openvoice.make(openvoice.Settings(reference="/nobody.wav"), None)


def test_nothing_is_downloaded_meanwhile(installed, fake, monkeypatch):
    from huggingface_hub import constants

    seen = []
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", False)

    def speak(self, text, *rest, **more):
        seen.append(constants.HF_HUB_OFFLINE)
        if len(seen) == 2:
            raise ConnectionError("offline mode is enabled")
        return np.zeros(100, np.float32)

    monkeypatch.setattr(fake.TTS, "tts_to_file", speak)
    openvoice.make(openvoice.Settings(), None)
    assert seen == [True] and not constants.HF_HUB_OFFLINE
    with pytest.raises(MissingModelError, match=r"downloaded \(offline mode is enabled\)"):
        openvoice.make(
            openvoice.Settings(
                "FR",
            ),
            None,
        )
    assert not constants.HF_HUB_OFFLINE


def is_installed(name):
    return name not in sys.modules and importlib.util.find_spec(name) is not None


@pytest.mark.parametrize("real", [False, True])
def test_the_api_is_the_documented_one(fake, real):
    if not real:
        melo = converter = fake
    elif is_installed("melo") and is_installed("openvoice"):
        melo = importlib.import_module("melo.api")
        converter = importlib.import_module("openvoice.api")
    else:
        pytest.skip("OpenVoice and MeloTTS are not installed")

    def parameters(function):
        return list(inspect.signature(function).parameters)

    base = parameters(melo.TTS)
    assert base[:2] == ["language", "device"] and {"config_path", "ckpt_path"} <= set(base)
    speak = parameters(melo.TTS.tts_to_file)
    assert speak[1:4] == ["text", "speaker_id", "output_path"] and {"speed", "quiet"} <= set(speak)
    kind = converter.ToneColorConverter
    assert parameters(kind.__base__) == ["config_path", "device"]
    assert parameters(kind.load_ckpt)[1:] == ["ckpt_path"]
    assert parameters(kind.extract_se)[1] == "ref_wav_list"
    assert parameters(kind.convert)[1:5] == ["audio_src_path", "src_se", "tgt_se", "output_path"]


def test_a_reference_is_judged_before_it_is_listened_to(installed, fake, tmp_path):
    path = tmp_path / "me.wav"
    soundfile.write(path, np.zeros(1000), 1)
    settings = openvoice.Settings(reference=str(path), **CONSENT)
    with pytest.raises(SettingsError, match="claims 1 samples per second"):
        openvoice.make(settings, None)
    assert not fake.ToneColorConverter.made
    path.write_bytes(b"no sound at all")
    with pytest.raises(SettingsError, match="is no sound"):
        openvoice.make(settings, None)
