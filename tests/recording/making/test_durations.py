"""How long an avatar will take: measured beside the server, when nothing else is going on."""

import os
import sys
import time

import pytest

from ico3d.creating.settings import QUALITIES
from ico3d.recording.making import durations as room
from ico3d.recording.making.durations import Durations
from ico3d.recording.making.sources import Recorded
from support.studio_page.parts import begun, kept

MODULE = "support.studio_page.pretended_pace"
WEBM = b"\x1a\x45\xdf\xa3" + bytes(60)
PATIENCE = 60.0


@pytest.fixture
def person(tmp_path):
    found = begun(tmp_path)
    kept(found, "consent", WEBM, seconds=1000.0)  # no picture of it is learnt from
    return found


@pytest.fixture
def said(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))  # of the tests
    return lambda text: monkeypatch.setenv("PACE", text)


def _measured(durations):
    durations.begin()
    durations._thread.join(PATIENCE)
    assert not durations._thread.is_alive()
    return durations


def test_each_quality_has_its_time_once_something_is_recorded(person, said):
    said("seconds of a step: 0.02")
    durations = Durations(lambda: False, MODULE)
    kept(person, "text-1", WEBM, seconds=40.0)
    assert durations.of(Recorded.of(person)) == {}
    _measured(durations)
    found = durations.of(Recorded.of(person))
    assert list(found) == list(QUALITIES)
    assert 60 < found["quick"] < found["good"] < found["best"]
    kept(person, "left", WEBM, seconds=40.0)
    assert durations.of(Recorded.of(person))["quick"] > found["quick"]
    person.remove("text-1")
    assert durations.of(Recorded.of(person)) == found
    person.remove("left")
    assert durations.of(Recorded.of(person)) == {}
    durations.close()


@pytest.mark.parametrize("text", ["no number", "seconds of a step: 0", "seconds of a step: ."])
def test_a_machine_that_cannot_be_measured_shows_no_time(person, said, text):
    said(text)
    kept(person, "text-1", WEBM, seconds=40.0)
    durations = _measured(Durations(lambda: False, MODULE))
    assert durations.of(Recorded.of(person)) == {}
    durations.close()


def test_a_machine_at_work_is_measured_later(person, said, monkeypatch):
    said("seconds of a step: 0.02")
    monkeypatch.setattr(room, "AGAIN", 0.01)
    busy = [True, True, False]
    durations = _measured(Durations(lambda: busy.pop(0), MODULE))
    assert busy == []
    kept(person, "text-1", WEBM, seconds=40.0)
    assert durations.of(Recorded.of(person))
    durations.close()


def test_a_server_that_ends_ends_the_measuring(said, monkeypatch):
    said("wait")
    durations = Durations(lambda: False, MODULE)
    durations.begin()
    end = time.monotonic() + PATIENCE
    while durations._process is None and time.monotonic() < end:
        time.sleep(0.01)
    durations.close()
    assert durations._process is not None and durations._process.poll() is not None
    waiting = Durations(lambda: True, MODULE)
    waiting.begin()
    waiting.close()
    assert waiting._process is None and not waiting._thread.is_alive()
    Durations(lambda: False, MODULE).close()  # that never began
