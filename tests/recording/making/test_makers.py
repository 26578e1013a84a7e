"""The processes that make avatars: one at a time, stopped, gone on with after a restart."""

import os
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from ico3d.avatar.embodying.look import Look
from ico3d.errors import StorageError
from ico3d.failures import FAILURES
from ico3d.recording.keeping import people as keeping
from ico3d.recording.keeping.body_choice import BodyChoice, write_choice
from ico3d.recording.keeping.people import People
from ico3d.recording.keeping.person import Person
from ico3d.recording.making import makers as room
from ico3d.recording.making.makers import Bodies, Makers
from ico3d.recording.making.places import Places
from ico3d.recording.making.progress import Progress, read_progress, write_progress
from ico3d.recording.making.sources import Recorded
from ico3d.recording.refusals import Refused
from support.studio_page.parts import begun, kept

WORKER = "support.studio_page.pretended_worker"
WEBM = b"\x1a\x45\xdf\xa3" + bytes(60)


@pytest.fixture
def people(tmp_path):
    for name in ("Ada", "Ida"):
        person = begun(tmp_path, name)
        for id in ("consent", "text-1"):
            kept(person, id, WEBM)
    return People(tmp_path)


@pytest.fixture
def makers(people, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))  # of the tests
    made = Makers(people, worker=WORKER)
    yield made
    made.close()


def _until(is_so):
    while not is_so():
        time.sleep(0.01)


def _began(person):
    return Places(person.folder).folder / "began"


def _codes(act):
    with pytest.raises(Refused) as refused:
        act()
    return refused.value.code


def test_one_at_a_time_and_stopped_for_good(people, makers):
    ada, ida = people.person("Ada"), people.person("Ida")
    assert makers.progress(ada) is None
    makers.begin(ada, "good")
    _until(_began(ada).exists)
    assert makers.progress(ada).state == "running"
    assert _codes(lambda: makers.begin(ida, "good")) == "busy"
    makers.stop(ada)
    assert makers.progress(ada).state == "stopped"
    makers.begin(ida, "best")
    _until(_began(ida).exists)
    assert _began(ida).read_text() == "best"


def test_what_falls_over_is_said(people, makers):
    ada = people.person("Ada")
    makers.begin(ada, "quick")
    _until(lambda: makers.progress(ada).state != "running")
    assert "begin again, it goes on where it was" in makers.progress(ada).error
    assert makers.progress(ada).code == "ended"
    assert (Places(ada.folder).folder / "log.txt").exists()


def test_what_the_system_kills_is_said_and_goes_on(people, makers):
    ada = people.person("Ada")
    makers.begin(ada, "good")
    _until(_began(ada).exists)
    os.kill(makers._running["Ada"].pid, signal.SIGKILL)  # as where memory runs out
    _until(lambda: makers.progress(ada).state != "running")
    found = makers.progress(ada)
    assert (found.state, found.code, found.error) == ("failed", "killed", FAILURES["killed"])
    makers.begin(ada, "good")
    assert makers.progress(ada).code == ""


def test_who_asks_how_far_it_is_brings_nothing_back_that_is_deleted_meanwhile(
    people, makers, monkeypatch
):
    ada, read = people.person("Ada"), room.read_progress
    folder = Places(ada.folder).folder
    folder.mkdir()
    write_progress(folder, Progress("running", "good"))  # and nobody is at work

    def delete():
        makers.stop(ada)
        people.delete("Ada")

    other = threading.Thread(target=delete)

    def look(folder):
        found = read(folder)
        if other.ident is None:
            other.start()
            other.join(0.1)  # as long as it may
        return found

    monkeypatch.setattr(room, "read_progress", look)
    assert makers.progress(ada).state == "failed"
    other.join()
    assert [path.name for path in people.folder.iterdir()] == ["Ida"]


def _on_the_way(person, made_of=None):
    """Files of a making that was stopped."""
    places = Places(person.folder)
    files = places.joined, places.joined_of, places.made, places.work / "capture-fine" / "0.jpg"
    files += (places.folder / ".joined.0123456789abcdef.mp4",)  # as killed writers leave them
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    if made_of is not None:
        write_progress(places.folder, Progress("stopped", "good", made_of=made_of))
    return lambda: {file.exists() for file in files}


def test_a_part_goes_with_what_was_made_of_it_on_the_way(people, makers):
    ada = people.person("Ada")
    places = Places(ada.folder)
    places.avatar.touch()
    for made_of in ({"parts": [["text-1.webm", 64, 0.0]]}, {}, {"parts": 3}):
        kept(ada, "text-1", WEBM)
        kept(ada, "text-2", WEBM)
        there = _on_the_way(ada, made_of)
        if made_of.get("parts") not in (None, 3):
            makers.withdraw(ada, "text-2")  # recorded since
            assert there() == {True} and [part.id for part in ada.parts()] == ["consent", "text-1"]
        makers.withdraw(ada, "text-1")
        assert there() == {False} and places.avatar.exists()
        assert makers.progress(ada).state == "stopped"
        ada.remove("text-2")
    assert _codes(lambda: makers.withdraw(ada, "text-70")) == "part"


def test_without_the_consent_nothing_goes_on(people, makers):
    ada = people.person("Ada")
    makers.begin(ada, "good")
    _until(_began(ada).exists)
    process, there = makers._running["Ada"], _on_the_way(ada)
    makers.withdraw(ada, "consent")
    assert process.poll() is not None and makers.progress(ada).state == "stopped"
    assert there() == {False} and [part.id for part in ada.parts()] == ["text-1"]
    assert _codes(lambda: makers.begin(ada, "good")) == "unspoken"


def test_a_full_disk_keeps_nobody_from_stopping(people, makers, monkeypatch):
    def full(*_):
        raise StorageError("the disk is full.")

    ada = people.person("Ada")
    makers.begin(ada, "good")
    _until(_began(ada).exists)
    process = makers._running["Ada"]
    monkeypatch.setattr(room, "write_progress", full)
    makers.stop(ada)
    people.delete("Ada")
    assert process.poll() is not None and people.names() == ["Ida"]


def test_a_log_that_leads_elsewhere_is_not_written(people, makers, tmp_path):
    ada, elsewhere = people.person("Ada"), tmp_path / "elsewhere"
    log = Places(ada.folder).folder / "log.txt"
    log.parent.mkdir()
    elsewhere.touch()
    log.symlink_to(elsewhere)
    makers.begin(ada, "quick")
    _until(lambda: makers.progress(ada).state != "running")
    assert log.is_file() and not log.is_symlink()
    log.unlink()
    os.mkfifo(log)
    makers.begin(ada, "quick")
    assert log.is_file()


def test_a_server_that_comes_back_goes_on(people, makers):
    ada = people.person("Ada")
    makers.begin(ada, "good")
    _until(_began(ada).exists)
    _began(ada).unlink()
    makers.close()
    assert read_progress(Places(ada.folder).folder).state == "running"
    ida = Places(people.person("Ida").folder).folder
    ida.mkdir()
    write_progress(ida, Progress("running", "good"))  # there may be but one
    again = Makers(people, worker=WORKER)
    try:
        again.go_on()
        _until(_began(ada).exists)
        assert read_progress(ida).state == "stopped"
    finally:
        again.close()


def test_a_server_starts_whatever_lies_in_somebodys_folder(people, makers, monkeypatch, caplog):
    ida = Places(people.person("Ida").folder).folder
    (ida / "log.txt").mkdir(parents=True)
    write_progress(ida, Progress("running", "good"))
    makers.go_on()  # a folder is no log to write into
    assert "Ida is not gone on with" in caplog.text and not makers._running

    def full(*_):
        raise StorageError("the disk is full.")

    def refused(*_):
        raise PermissionError(13, "Permission denied")

    ada = people.person("Ada")
    ada.remove("consent")  # so that it is stopped
    Places(ada.folder).folder.mkdir()
    write_progress(Places(ada.folder).folder, Progress("running", "good"))
    monkeypatch.setattr(room, "write_progress", refused)
    makers.go_on()
    assert "Ada is not gone on with" in caplog.text
    (ida / "log.txt").rmdir()
    monkeypatch.setattr(room, "write_progress", full)
    makers.go_on()
    assert "the disk is full" in caplog.text and not makers._running


def test_a_server_that_is_killed_takes_its_processes_along(people, makers):
    ada = people.person("Ada")
    makers.begin(ada, "good")
    _until(_began(ada).exists)
    process = makers._running["Ada"]
    process.stdin.close()  # as the system does for a killed one
    _until(lambda: process.poll() is not None)


def test_consent_comes_first(people, makers):
    ada = people.person("Ada")
    ada.remove("consent")
    assert _codes(lambda: makers.begin(ada, "good")) == "unspoken"
    ida = people.person("Ida")
    ida.remove("text-1")
    assert _codes(lambda: makers.begin(ida, "good")) == "nothing"
    assert _codes(lambda: makers.begin(ida, "perfect")) == "quality"


def test_the_body_and_its_look_are_passed_on(people, monkeypatch):
    asked = []

    class Process:
        def poll(self):
            return 0

    monkeypatch.setattr(room, "start", lambda worker, words, log: asked.append(words) or Process())
    ada, ida = people.person("Ada"), people.person("Ida")
    slender = Bodies(Path("mine.ico3d"), BodyChoice(True, Look("slender", "navy")))
    write_choice(ida.folder, BodyChoice(True, Look("sturdy", "wine")))
    for made in (Makers(people), Makers(people, slender)):
        made.begin(ada, "good")
        made.begin(ida, "good")
    write_choice(ada.folder, BodyChoice(False))
    made.begin(ada, "good")
    assert asked == [
        [str(ada.folder), "good"],
        [str(ida.folder), "good", "demo", "sturdy", "wine"],
        [str(ada.folder), "good", "mine.ico3d", "slender", "navy"],
        [str(ida.folder), "good", "mine.ico3d", "sturdy", "wine"],
        [str(ada.folder), "good"],
    ]


def test_what_has_changed_since_a_making_began_is_known(people, makers):
    ada = people.person("Ada")
    makers.begin(ada, "good")
    _until(_began(ada).exists)
    makers.stop(ada)

    def changed():
        return makers.changed(ada, makers.progress(ada), Recorded.of(ada))

    assert changed() == []
    write_choice(ada.folder, BodyChoice(True))
    assert changed() == ["on"]
    kept(ada, "text-2", WEBM)
    assert changed() == ["parts", "on"]
    makers.begin(ada, "good")
    assert changed() == []


def test_nobody_waits_for_the_removal_of_what_another_one_made(people, makers, monkeypatch):
    ada, ida = people.person("Ada"), people.person("Ida")
    held, removed = threading.Event(), []

    def slow(paths):
        assert held.wait(20)
        removed.extend(paths)

    monkeypatch.setattr(keeping, "PATIENCE", 0.01)
    monkeypatch.setattr(keeping, "remove", slow)
    acts = [
        lambda: makers.discard(ada),
        lambda: makers.begin(ada, "good", anew=True),
        lambda: makers.withdraw(ada, "text-1"),
    ]
    for act in acts:
        work = Places(ada.folder).work
        makers.begin(ada, "good")
        makers.stop(ada)
        work.mkdir(exist_ok=True)
        (work / "made").touch()
        act()  # does not wait for its end either
        assert not (work / "made").exists() and makers.progress(ida) is None and not removed
        held.set()
        _until(lambda: removed)
        assert {path.parent for path in removed} == {people.folder}
        held.clear()
        removed.clear()
        makers.stop(ada)


def test_nobody_waits_for_the_crowded_parts_of_another_one(people, makers, monkeypatch):
    """Side by side, removals of 20,000 files each held up all others for 15 s."""
    held, removed, at_once = threading.Event(), [], []

    def slow(person, id, until):
        at_once.append(len(at_once) - len(removed))  # of the others, those that go on
        assert held.wait(20) and until <= time.time()
        removed.append((person.name, id))

    monkeypatch.setattr(keeping, "PATIENCE", 0.2)
    monkeypatch.setattr("ico3d.recording.keeping.person.MOST_FILES", 1)
    monkeypatch.setattr(Person, "remove_rest", slow)
    names = ("Ada", "Ida")
    took = []
    for name in names:
        begin = time.monotonic()
        makers.withdraw(people.person(name), "text-1")
        took.append(time.monotonic() - begin)
        assert people.person(name).part("text-1") is None  # what one sees goes at once
    assert took[0] > 0.19 and took[1] < 0.15
    held.set()
    _until(lambda: len(removed) == 2)
    assert removed == [(name, "text-1") for name in names] and at_once == [0, 0]


def test_a_making_is_begun_anew_or_discarded_and_a_finished_avatar_stays(people, makers):
    ada = people.person("Ada")
    places = Places(ada.folder)
    places.avatar.write_bytes(b"an earlier one")
    for act in (lambda: makers.begin(ada, "good", anew=True), lambda: makers.discard(ada)):
        makers.stop(ada)
        makers.begin(ada, "good")
        _until(_began(ada).exists)
        makers.stop(ada)
        learnt = places.folder / "learnt"
        learnt.touch()
        makers.begin(ada, "good")
        assert learnt.exists()
        makers.stop(ada)
        act()
        assert not learnt.exists()
    assert makers.progress(ada) is None and not places.folder.exists()
    assert places.avatar.read_bytes() == b"an earlier one"
    assert {part.id for part in ada.parts()} == {"consent", "text-1"}
