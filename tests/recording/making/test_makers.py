"""The processes that make avatars: one at a time, stopped, gone on with after a restart."""

import os
import sys
import time
from pathlib import Path

import pytest

from ico3d.avatar.embodying.look import Look
from ico3d.recording.keeping.people import People
from ico3d.recording.making import makers as room
from ico3d.recording.making.makers import Makers
from ico3d.recording.making.places import Places
from ico3d.recording.making.progress import Progress, read_progress, write_progress
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
    assert (Places(ada.folder).folder / "log.txt").exists()


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
    ada = people.person("Ada")
    for made in (Makers(people), Makers(people, Path("demo"), Look("slender", "navy"))):
        made.begin(ada, "good")
    assert asked == [
        [str(ada.folder), "good"],
        [str(ada.folder), "good", "demo", "slender", "navy"],
    ]
