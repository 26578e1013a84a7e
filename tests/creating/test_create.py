"""From a video to an avatar, with a recording of a few tiny pictures in the tracker's place."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from ico3d.avatar.baking import head_bundle
from ico3d.avatar.baking.shader_head import BakeSettings
from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import FILE
from ico3d.bundle.people.provenance import OPENVOICE, ClonedVoice
from ico3d.capture.portrait.settings import CUTOUTS, FACES, POSES
from ico3d.cli import main
from ico3d.creating import create as room
from ico3d.creating import plan
from ico3d.creating.create import create
from ico3d.creating.events import STEPS, Advanced, Looked, Made, Planned, Preview
from ico3d.creating.looking.advice import Advice
from ico3d.creating.looking.examine import Examination
from ico3d.creating.settings import QUALITIES, CreateSettings, Quality
from ico3d.creating.voice.clone import Cloned
from ico3d.errors import BundleError, CaptureError, SettingsError, StorageError
from ico3d.head.settings import Density, HeadSettings, Initial, Network
from support.bundles.random_bundle import write_random_bundle
from support.recordings.portrait_folder import write_folder

pytestmark = pytest.mark.slow

HEAD = HeadSettings(
    steps=12,
    checkpoint_every=4,
    network=Network(features=4, hidden=8),
    initial=Initial(200),
    density=Density(max_gaussians=200),
)
FOUND = Examination(30.0, 25.0, 512**2, (Advice("blur", spans=((2, 3),)),), True)


@pytest.fixture
def tracked(monkeypatch):
    """What was tracked, video by video."""
    videos = []

    def track(video, folder, how, reached):
        videos.append((video.name, how.consent, how.refine))
        for step in (FACES, CUTOUTS, POSES):
            reached(step, 0.5)
        write_folder(folder)

    monkeypatch.setattr(room, "track_portrait", track)
    monkeypatch.setattr(room, "examine", lambda video, size, reached: FOUND)
    monkeypatch.setattr(room, "set_pace", lambda device: 0.02)
    quick = partial(BakeSettings, 32, augmented=20, steps=40)
    monkeypatch.setattr(head_bundle, "BakeSettings", quick)
    for name in QUALITIES:
        monkeypatch.setitem(QUALITIES, name, Quality("exact", 22, True, HEAD))
    return videos


@pytest.fixture
def settings(tmp_path):
    (tmp_path / "ada.mp4").write_bytes(b"a video")
    return CreateSettings(tmp_path / "ada.mp4", tmp_path / "ada.ico3d", consent="yes")


def test_nothing_is_made_of_somebody_who_did_not_agree(tracked, settings):
    with pytest.raises(SettingsError, match=r"--consent"):
        create(replace(settings, consent="not stated"), print)
    assert not tracked and not settings.out.exists()


def test_the_whole_way_and_again(tracked, settings, capfd):
    told = []
    made = create(settings, told.append)
    assert tracked == [("ada.mp4", "yes", True)]
    manifest = Bundle.open(settings.out).manifest
    assert manifest.name == manifest.persona.name == "ada"
    assert manifest.persona.greeting == "Hello, I am ada."
    assert [type(event) for event in told[:2]] == [Looked, Planned] and told[-1] is made
    assert told[1].others.keys() == QUALITIES.keys()
    steps = [event.step for event in told if isinstance(event, Advanced)]
    assert list(dict.fromkeys(steps)) == list(STEPS[1:])
    shares = [e.share for e in told if isinstance(e, Advanced) and e.step == "learn"]
    assert shares == [i / 12 for i in range(1, 13)]
    faces = [event.picture for event in told if isinstance(event, Preview)]
    assert len(faces) == 12 and faces[0].shape == (64, 128, 3)
    face = made.measured.face
    assert made.measured.pictures == 2 and face is not None and 0 < face < 60
    assert made.strip.is_file()
    again = []
    assert create(settings, again.append).measured == made.measured
    assert [type(event) for event in again] == [Made] and len(tracked) == 1


def test_on_the_body_of_another(tracked, settings, monkeypatch, capfd):
    put = []

    def run(embody):
        look = (embody.build, embody.outfit)
        put.append(look if put else (embody.body.name, embody.head.name, *look))
        embody.out.write_bytes(embody.head.read_bytes())

    monkeypatch.setattr(room.Embody, "run", run)
    settings = replace(settings, body=FILE)
    create(settings, [].append)
    assert put == [(FILE.name, room.HEAD_ALONE, "medium", "recorded")] and settings.out.is_file()
    create(settings, [].append)
    assert len(put) == 1
    create(replace(settings, build="sturdy", outfit="navy"), [].append)
    assert put[1:] == [("sturdy", "navy")]
    create(replace(settings, body=None), [].append)
    assert len(put) == 2 and len(tracked) == 1


VOICE = Cloned(np.ones(256, np.float32), ClonedVoice(OPENVOICE, "ada.mp4", "my voice, too"))


def _cloning(monkeypatch, voice):
    """What is asked to be cloned; the result is `voice`."""
    asked = []

    def clone(settings, place, tell):
        asked.append(settings.voice_consent)
        return voice

    monkeypatch.setattr(room, "clone", clone)
    monkeypatch.setattr(room, "awaits_voice", lambda *_: False)
    return asked


def test_the_avatar_gets_the_voice(tracked, settings, monkeypatch, capfd):
    asked = _cloning(monkeypatch, VOICE)
    settings = replace(settings, voice_consent="my voice, too")
    create(settings, [].append)
    bundle = Bundle.open(settings.out)
    assert bundle.manifest.provenance.voice == VOICE.about and bundle.voice is not None
    assert bundle.manifest.provenance.consent == "yes" and (bundle.voice == 1).all()
    create(settings, [].append)
    assert asked == ["my voice, too"]  # it is there already
    monkeypatch.setattr(room, "clone", lambda *_: None)
    create(replace(settings, voice_consent=""), [].append)  # withdrawn
    assert Bundle.open(settings.out).voice is None and len(tracked) == 1


def test_the_voice_comes_along_onto_the_body_of_another(tracked, settings, monkeypatch, capfd):
    _cloning(monkeypatch, VOICE)
    put = []

    def run(embody):
        put.append(Bundle.open(embody.head).manifest.provenance.voice)
        embody.out.write_bytes(embody.head.read_bytes())

    monkeypatch.setattr(room.Embody, "run", run)
    create(replace(settings, body=FILE, voice_consent="my voice, too"), [].append)
    assert put == [VOICE.about]


def test_a_body_that_cannot_be_used_is_told_before_the_work(tracked, settings, tmp_path):
    write_random_bundle(tmp_path / "head.ico3d", 60)
    for body, why in (("head.ico3d", "no body on a skeleton"), ("none.ico3d", "no bundle at")):
        with pytest.raises(BundleError, match=why):
            create(replace(settings, body=tmp_path / body), print)
    assert not tracked and not settings.out.exists()


def test_a_head_alone_has_no_build(tracked, settings):
    with pytest.raises(SettingsError) as refused:
        create(replace(settings, build="slender"), print)
    assert str(refused.value) == (
        "--build and --outfit are those of a stand-in's body: say which one by --body, such as "
        "--body demo."
    )
    assert not tracked


def test_it_goes_on_where_it_was_stopped(tracked, settings, capfd):
    def stop_at(event):
        if isinstance(event, Preview) and event.share > 0.7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        create(settings, stop_at)
    assert not settings.out.exists()
    told = []
    create(settings, told.append)
    assert len(tracked) == 1
    (planned,) = [event for event in told if isinstance(event, Planned)]
    assert planned.seconds["track"] == 0 and planned.seconds["learn"] > 0
    first = next(e.share for e in told if isinstance(e, Advanced) and e.step == "learn")
    assert first == 9 / 12


@pytest.mark.parametrize("linked", [False, True])
def test_what_an_earlier_version_began_is_learnt_anew(
    linked, tracked, settings, monkeypatch, tmp_path
):
    def stop_at(event):
        if isinstance(event, Preview):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        create(settings, stop_at)
    begun = settings.out.with_suffix(".work") / f"head-{settings.quality}"
    elsewhere = tmp_path / "elsewhere"
    if linked:
        begun.rename(elsewhere)
        begun.symlink_to(elsewhere)
    newer = Quality("exact", 22, True, replace(HEAD, steps=13))
    monkeypatch.setitem(QUALITIES, settings.quality, newer)
    told = []
    create(settings, told.append)
    assert len(tracked) == 1  # its tracking counts
    assert next(e.share for e in told if isinstance(e, Advanced) and e.step == "learn") == 1 / 13
    assert settings.out.is_file() and not begun.is_symlink()
    assert not linked or any(elsewhere.iterdir())  # what a link leads to is somebody else's


def test_a_video_of_which_nothing_can_be_made(tracked, settings, monkeypatch, capfd):
    worse = Examination(30.0, 25.0, 512**2, (Advice("face-none", "refused"),), True)
    monkeypatch.setattr(room, "examine", lambda *_: worse)
    told = []
    with pytest.raises(CaptureError, match=r"ada\.mp4: no face is found: film one"):
        create(settings, told.append)
    assert [type(event) for event in told] == [Looked] and not tracked
    assert settings.video.read_bytes() == b"a video"


def test_a_disk_without_room_is_told_before_the_work(tracked, settings, monkeypatch):
    usage = type("Usage", (), {"free": 1e8})
    monkeypatch.setattr(plan.shutil, "disk_usage", lambda _: usage)
    with pytest.raises(StorageError, match=r"has 0\.1 GB left and 0\.5 GB are needed"):
        create(settings, lambda _: None)
    assert not tracked


def test_the_terminal_says_what_matters(tracked, settings, capfd):
    words = ["create", str(settings.video), str(settings.out), "--consent", "yes"]
    assert main(words) == 0
    said = " ".join(capfd.readouterr().out.split())
    for part in (
        "What would make the avatar better: - at 2 to 3 s: the face is blurred: wipe the lens",
        "Quality good takes about",
        "all in all: quick",
        "On 2 pictures that it never saw:",
        f"Talk with it: ico3d serve {settings.out}",
    ):
        assert part in said
    assert settings.out.with_suffix(".work").joinpath("face.jpg").is_file()
