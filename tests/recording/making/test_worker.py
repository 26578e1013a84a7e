"""The making of an avatar: which video, when anew, and what becomes of errors."""

import subprocess
import sys
from pathlib import Path

import pytest

from ico3d.avatar.forgetting.removal import check_idle
from ico3d.creating.events import Advanced, Made, Measured
from ico3d.errors import CaptureError, SettingsError
from ico3d.recording.beside import stop
from ico3d.recording.keeping.people import People
from ico3d.recording.making import worker
from ico3d.recording.making.places import Places
from ico3d.recording.making.progress import read_progress
from support.needs import needs
from support.studio_page.parts import DAY, begun, kept, part_file

pytestmark = needs("av")


@pytest.fixture
def person(tmp_path):
    return begun(tmp_path / "recordings")


@pytest.fixture
def asked(monkeypatch):
    """The settings of each creation; what it makes is as long as its video."""
    calls = []

    def create(settings, tell):
        calls.append(settings)
        tell(Advanced("bake", 1.0, "made"))
        settings.out.with_suffix(".work").mkdir(exist_ok=True)
        settings.out.write_bytes(b"avatar of %d" % settings.video.stat().st_size)
        tell(Made(settings.out, settings.out, Measured(30.0, None, 1), 1.0))

    monkeypatch.setattr(worker, "create", create)
    return calls


def _recorded(person, tmp_path, *ids, frames=5):
    data = part_file(tmp_path / "part.mp4", frames).read_bytes()
    for id in ids:
        kept(person, id, data)


def test_parts_become_an_avatar_that_says_who_agreed(person, asked, tmp_path):
    _recorded(person, tmp_path, "consent", "left", "text-1")
    avatar = worker.make(person, "quick")
    places = Places(person.folder)
    assert avatar == places.avatar == person.folder / "Ida.ico3d" and avatar.is_file()
    (settings,) = asked
    assert (settings.video, settings.out.stem, settings.quality) == (places.joined, "Ida", "quick")
    assert "ticked and spoken: “I am Ida." in settings.consent
    assert (settings.licence, settings.made_by) == ("for this person's own use", "Ida")
    found = read_progress(places.folder)
    assert found is not None and (found.state, found.decibels) == ("made", 30.0)


def test_a_voice_is_cloned_only_of_those_who_agreed_to_it(person, asked, tmp_path):
    _recorded(person, tmp_path, "consent", "text-1")
    worker.make(person, "quick")
    ada = People(tmp_path / "recordings").begin("Ada", "en", True, DAY, voice=True)
    _recorded(ada, tmp_path, "consent", "text-1")
    worker.make(ada, "quick")
    silent, voiced = asked
    assert silent.voice_consent == ""
    assert voiced.voice_consent == (
        "agreed on 2026-11-24, ticked and spoken: “I also agree that the avatar speaks with an "
        "imitation of my voice, made from this recording.”"
    )


def test_the_body_of_another_is_asked_for(person, asked, tmp_path, monkeypatch):
    _recorded(person, tmp_path, "consent", "text-1")
    monkeypatch.setattr(worker, "end_with_parent", lambda: None)
    monkeypatch.setattr(worker, "limit_to_free_memory", lambda: None)  # it would stay
    monkeypatch.setattr(worker.sys, "argv", ["worker", str(person.folder), "quick", "demo"])
    assert worker.main() == 0
    monkeypatch.setattr(worker.sys, "argv", ["worker", str(person.folder), "quick"])
    assert worker.main() == 0
    assert [settings.body for settings in asked] == [Path("demo"), None]
    chosen = ["worker", str(person.folder), "quick", "demo", "sturdy", "wine"]
    monkeypatch.setattr(worker.sys, "argv", chosen)
    assert worker.main() == 0
    looks = [(settings.build, settings.outfit) for settings in asked]
    assert looks == [("medium", "recorded")] * 2 + [("sturdy", "wine")]


def test_nobody_is_forgotten_while_a_making_writes_there(person, asked, tmp_path, monkeypatch):
    """Also before `create` begins, which has a lock of its own."""
    _recorded(person, tmp_path, "consent", "text-1")
    monkeypatch.setattr(worker, "end_with_parent", lambda: None)
    monkeypatch.setattr(worker, "limit_to_free_memory", lambda: None)
    monkeypatch.setattr(worker.sys, "argv", ["worker", str(person.folder), "quick"])
    Places(person.folder).folder.mkdir()
    check_idle([person.folder])
    assert worker.main() == 0
    with pytest.raises(SettingsError, match=r"a process works at .*making just now"):
        check_idle([person.folder])


def test_a_making_that_takes_more_than_is_free_ends_with_a_sentence(person, tmp_path):
    """Whichever library asks for it; in a process of its own, whose limit would stay."""
    _recorded(person, tmp_path, "consent", "text-1")
    code = (
        "import contextlib, pathlib, sys\n"
        "import numpy, torch\n"
        "from ico3d.common.unpacking import limits\n"
        "from ico3d.recording.making import worker\n"
        "from ico3d.recording.making.progress import read_progress\n"
        "limits.LEAST_BYTES, limits.free_memory = 64 << 20, lambda: 256 << 20\n"
        f"sys.argv = ['worker', {str(person.folder)!r}, 'quick']\n"
        "worker.create = lambda settings, tell: numpy.ones(1 << 28)\n"
        "with contextlib.suppress(MemoryError):\n"
        "    worker.main()\n"
        f"found = read_progress(pathlib.Path({str(Places(person.folder).folder)!r}))\n"
        "assert (found.state, found.code) == ('failed', 'memory')\n"
        "worker.create = lambda settings, tell: torch.ones(1 << 28)\n"
        "print('and so does torch', flush=True)\n"
        "worker.main()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        assert process.wait(120) == 1 and process.stdout is not None
        assert process.stdout.read() == b"and so does torch\n"
    finally:
        stop(process)
    found = read_progress(Places(person.folder).folder)
    assert found is not None and (found.state, found.code) == ("failed", "memory")


def test_the_same_parts_go_on_and_other_parts_begin_anew(person, asked, tmp_path):
    _recorded(person, tmp_path, "consent", "text-1")
    worker.make(person, "quick")
    places = Places(person.folder)
    mark = places.work / "trained"
    mark.touch()
    worker.make(person, "good")
    assert mark.exists()
    _recorded(person, tmp_path, "text-1", frames=9)  # a retake
    first = places.avatar.read_bytes()
    worker.make(person, "good")
    assert not mark.exists() and places.avatar.read_bytes() != first


def test_a_video_that_was_brought_takes_the_place_of_the_parts(person, asked, tmp_path):
    _recorded(person, tmp_path, "consent", "text-1")
    worker.make(person, "quick")
    assert Places(person.folder).joined.is_file()
    _recorded(person, tmp_path, "upload")
    worker.make(person, "quick")
    assert asked[1].video == person.folder / "parts" / "upload.mp4"
    assert not Places(person.folder).joined.exists()  # parts leave nothing when they are deleted


def test_an_error_is_one_sentence_and_an_earlier_avatar_stays(person, asked, tmp_path, monkeypatch):
    _recorded(person, tmp_path, "consent", "text-1")
    avatar = worker.make(person, "quick").read_bytes()

    def refuse(settings, tell):
        raise CaptureError(f"{settings.video}: two faces are seen.")

    monkeypatch.setattr(worker, "create", refuse)
    with pytest.raises(CaptureError):
        worker.make(person, "good")
    found = read_progress(Places(person.folder).folder)
    assert found is not None and (found.state, found.error) == ("failed", "two faces are seen.")
    assert Places(person.folder).avatar.read_bytes() == avatar
    assert {part.id for part in person.parts()} == {"consent", "text-1"}


def test_nothing_recorded_is_said(person, asked, tmp_path):
    _recorded(person, tmp_path, "consent")
    with pytest.raises(CaptureError, match="there is no recording"):
        worker.make(person, "quick")
