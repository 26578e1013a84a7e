"""Cloning: only with a consent of its own, once, and never in the way of the avatar."""

import json
from dataclasses import replace

import numpy as np
import pytest

from support.needs import needs

pytestmark = [
    *(needs(one) for one in ("pipecat", "torch", "soundfile", "av", "espeakng_loader")),
    pytest.mark.slow,
]

from ico3d.bundle.format import Bundle  # noqa: E402
from ico3d.bundle.people.provenance import OPENVOICE, ClonedVoice  # noqa: E402
from ico3d.bundle.people.voice import VOICE  # noqa: E402
from ico3d.cli import main  # noqa: E402
from ico3d.creating.events import Voiced  # noqa: E402
from ico3d.creating.looking.advice import Advice  # noqa: E402
from ico3d.creating.settings import CreateSettings  # noqa: E402
from ico3d.creating.voice import clone as room  # noqa: E402
from ico3d.creating.voice.clone import HEARD, awaits_voice, clone, heard  # noqa: E402
from ico3d.creating.workplace import workplace  # noqa: E402
from ico3d.errors import BundleError  # noqa: E402

AGREED = "I agree that it speaks with my voice."


@pytest.fixture(autouse=True)
def models(tmp_path, monkeypatch):
    """Where the weights lie of a user who has nothing."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)
    folder = tmp_path / "home/.cache/ico3d/models"
    folder.mkdir(parents=True)
    return folder


@pytest.fixture
def fake(monkeypatch, models):
    """OpenVoice is installed, with pretended weights."""
    from support.chat import fake_openvoice

    fake_openvoice.install(monkeypatch)
    fake_openvoice.write_weights(models)
    return fake_openvoice


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """A film of a grey wall before which somebody talks for 20 s."""
    from ico3d.avatar.film.video import write_video
    from ico3d.capture.capture import Sound
    from ico3d.common.espeak.speech import synthesize

    text = "The quick brown fox jumps over the lazy dog while five boys watch with pleasure. " * 4
    speech = synthesize(text, "en-us+m3", 150)
    path = tmp_path_factory.mktemp("video") / "ada.mp4"
    count = int(len(speech.samples) / speech.rate * 5)
    pictures = (np.full((64, 64, 3), 120, np.uint8) for _ in range(count))
    write_video(path, pictures, (64, 64), 5.0, Sound(0.5 * speech.samples, speech.rate))
    return path


@pytest.fixture
def settings(video, tmp_path):
    return CreateSettings(video, tmp_path / "ada.ico3d", consent="yes", voice_consent=AGREED)


def cloned(settings):
    """What comes of it, what is told, and whether a voice is kept."""
    told = []
    with workplace(settings) as place:
        found = clone(settings, place, told.append)
        return found, told, sorted(file.name for file in place.file("voice").glob("*"))


KEPT = ["cloned_voice.json", "voice.safetensors"]


def test_a_voice_is_cloned_once(settings, fake):
    found, (told,), kept = cloned(settings)
    assert found is not None and kept == KEPT
    assert found.about == ClonedVoice(OPENVOICE, "ada.mp4", AGREED)
    assert found.tone.shape == (256,) and np.ptp(found.tone) == 0  # as the pretended one says
    assert isinstance(told, Voiced) and told.why is None and told.seconds > 10
    [converter] = fake.ToneColorConverter.made
    again, same, _ = cloned(settings)
    assert again is not None and (again.tone == found.tone).all() and same == [told]
    assert fake.ToneColorConverter.made == [converter] and converter.extracted == 1


def test_the_sound_of_a_voice_lies_beside_the_avatar_and_is_gone_whatever_happens(tmp_path):
    """A killed process leaves nothing where neither `forget` nor anybody else looks."""
    file = tmp_path / "ada.work" / "voice" / HEARD

    def tell(path):
        assert path == file and path.read_bytes().startswith(b"RIFF")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        heard(np.zeros(100, np.float32), tell, file)
    assert not file.exists()


def test_a_kept_voice_that_is_a_hole_is_not_read(settings, fake):
    cloned(settings)
    with workplace(settings) as place, place.voice_file(VOICE).open("r+b") as file:
        file.truncate(1 << 33)
    with pytest.raises(BundleError, match="is no voice: delete it"):
        cloned(settings)


@pytest.mark.parametrize("consent", ["", " ", "not stated"])
def test_nothing_is_cloned_without_a_consent_that_covers_it(settings, fake, consent):
    assert cloned(replace(settings, voice_consent=consent)) == (None, [], [])
    assert not fake.ToneColorConverter.made
    cloned(settings)
    assert cloned(replace(settings, voice_consent=consent)) == (None, [], [])  # withdrawn: gone


def test_another_consent_clones_anew(settings, fake):
    cloned(settings)
    found, _, _ = cloned(replace(settings, voice_consent="Only on Sundays."))
    assert found is not None and found.about.consent == "Only on Sundays."
    assert len(fake.ToneColorConverter.made) == 2


def test_without_openvoice_the_avatar_is_made_without_it(settings, monkeypatch, models):
    monkeypatch.setattr(
        "ico3d.chat.services.voice.openvoice.cloning_hindrance", lambda: "openvoice is missing."
    )
    later = " The same command clones the voice once that is mended."
    why = Advice("voice-lacking", detail=f"openvoice is missing.{later}")
    assert cloned(settings) == (None, [Voiced(0.0, why)], [])


def test_it_is_cloned_as_soon_as_openvoice_is_there(settings, monkeypatch, request):
    with workplace(settings) as place:
        monkeypatch.setattr(room, "hindrance", lambda: "missing.")
        assert not awaits_voice(settings, place)
        monkeypatch.setattr(room, "hindrance", lambda: "")
        assert awaits_voice(settings, place)
        assert not awaits_voice(replace(settings, voice_consent=""), place)
        place.note_voice(settings, 0.0, Advice("voice-silent"))
        assert not awaits_voice(settings, place)  # nothing has changed about that


def test_a_recording_that_tells_no_voice_is_told_and_noted(settings, fake, monkeypatch):
    monkeypatch.setattr(room, "read_sound", lambda path, rate: None)
    expected = (None, [Voiced(0.0, Advice("voice-none"))], ["cloned_voice.json"])
    assert cloned(settings) == expected == cloned(settings)
    assert not fake.ToneColorConverter.made


def test_what_is_no_tone_colour_is_not_kept(settings, fake, monkeypatch):
    import torch

    monkeypatch.setattr(
        fake.ToneColorConverter, "extract_se", lambda *_: torch.full((1, 256, 1), torch.nan)
    )
    found, [told], kept = cloned(settings)
    assert found is None and not kept
    assert told.why.code == "voice-failed"
    fault = "voice.safetensors: 'tone_colour' holds a value that is not finite."
    assert told.why.detail.startswith(fault)


def test_what_openvoice_lacks_is_told(settings, fake, monkeypatch):
    def lacking(*_):
        raise ConnectionError("offline mode is enabled")

    monkeypatch.setattr(fake.ToneColorConverter, "load_ckpt", lacking)
    found, [told], _ = cloned(settings)
    assert found is None and told.why.code == "voice-failed"
    assert "lacks a part that would have to be downloaded" in told.why.detail


def test_a_reason_that_an_earlier_version_noted_is_looked_for_anew(settings, fake):
    with workplace(settings) as place:
        place.note_voice(settings, 0.0, Advice("voice-silent"))
        note = place.voice_file("cloned_voice.json")
        note.write_text(json.dumps(json.loads(note.read_text()) | {"fault": "it is silent."}))
        assert place.voice(settings) is None


def test_forgetting_a_person_forgets_the_voice(settings, fake, monkeypatch, tmp_path, capsys):
    _, _, kept = cloned(settings)
    monkeypatch.chdir(tmp_path)
    assert kept == KEPT and main(["forget", "Ada", "--yes"]) == 0
    assert "ada.work: a workplace, a cloned voice of ada" in capsys.readouterr().out
    assert not (tmp_path / "ada.work").exists()


def test_the_bundle_is_given_it(settings, fake, tmp_path):
    from ico3d.bundle.format import give_voice
    from support.bundles.random_bundle import write_random_bundle

    found, _, _ = cloned(settings)
    assert found is not None
    write_random_bundle(tmp_path / "plain.ico3d", 60)
    give_voice(tmp_path / "plain.ico3d", found.about, found.tone, settings.out)
    bundle = Bundle.open(settings.out)
    assert bundle.voice is not None and (bundle.voice == found.tone).all()


def test_the_terminal_says_whether_there_is_a_voice(settings, capsys):
    from ico3d.creating.telling import Terminal

    tell = Terminal(settings)
    tell(Voiced(31.4))
    tell(Voiced(0.0, Advice("voice-silent")))
    tell(Voiced(0.0, Advice("voice-lacking", detail="openvoice is not installed.")))
    assert capsys.readouterr().out.splitlines() == [
        "The avatar's voice is cloned from 31 s of clean speech.",
        "The avatar is made without a voice of its own: the recording is silent.",
        "The avatar is made without a voice of its own: OpenVoice, which imitates voices, is not "
        "installed here, or not all of it. openvoice is not installed.",
    ]
