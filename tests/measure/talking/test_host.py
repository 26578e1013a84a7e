"""Time that a host takes, from what Linux says of it."""

import os

import pytest

from ico3d.measure.talking import host

LINE = "cpu  100 0 50 900 0 0 3 {} 0 0\ncpu0 1 1 1 1 1 1 1 1 1 1\n"


def watched_from(monkeypatch, tmp_path, before, after, seconds):
    now = iter([10.0, 10.0 + seconds])
    monkeypatch.setattr(host, "STAT", tmp_path / "stat")
    monkeypatch.setattr(host.time, "monotonic", lambda: next(now))
    host.STAT.write_text(before)
    with host.watched() as stolen:
        host.STAT.write_text(after)
    return stolen


def test_ticks_become_cores(monkeypatch, tmp_path):
    ticks = os.sysconf("SC_CLK_TCK")
    before, after = LINE.format(7), LINE.format(7 + 3 * ticks)
    stolen = watched_from(monkeypatch, tmp_path, before, after, seconds=6.0)
    assert stolen.cores == pytest.approx(0.5)
    assert stolen.sentence().startswith("The host kept 0.50 of ")


@pytest.mark.parametrize("text", ["", "cpu  1 2 3\n", "cpu a b c d e f g h\n"])
def test_a_system_that_does_not_say(monkeypatch, tmp_path, text):
    stolen = watched_from(monkeypatch, tmp_path, text, text, seconds=1.0)
    assert stolen.cores is None and "not known" in stolen.sentence()


def test_other_systems_have_no_such_file(monkeypatch, tmp_path):
    monkeypatch.setattr(host, "STAT", tmp_path / "none")
    with host.watched() as stolen:
        pass
    assert stolen.cores is None
