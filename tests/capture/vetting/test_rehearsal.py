"""Films that take too much while they are opened are refused, whatever they are made of."""

import subprocess
import time
from unittest.mock import Mock

import av
import pytest

from ico3d.capture.multiview.clip import Clip
from ico3d.capture.vetting import rehearsal
from ico3d.capture.video import open_video, read_sound
from ico3d.errors import CaptureError
from support.recordings.films import write_film
from support.strangers.costly_films import SLOW, write_large

pytestmark = pytest.mark.slow


@pytest.fixture
def hurried(monkeypatch):
    """A film is given what is left of a second of processor time, to spare time."""
    monkeypatch.setattr(rehearsal, "MOST_SECONDS", 0)


@pytest.fixture
def started(monkeypatch):
    """The processes that were started."""
    found, run = [], subprocess.run

    def counted(*words, **options):
        found.append(words)
        return run(*words, **options)

    monkeypatch.setattr(rehearsal.subprocess, "run", counted)
    return found


@pytest.mark.parametrize("name", SLOW)
def test_a_film_that_takes_too_long_is_not_opened(tmp_path, hurried, monkeypatch, name):
    film = tmp_path / name
    film.write_bytes(SLOW[name]())
    monkeypatch.setattr(av, "open", lambda *_, **__: pytest.fail("it was opened"))
    assert film.stat().st_size < 6_000_000
    before = time.process_time()
    with pytest.raises(CaptureError, match="takes more time or memory than is given") as error:
        open_video(film, 48)
    assert error.value.code == "costly"
    assert time.process_time() - before < 1


def test_whoever_opens_a_film_opens_it_apart_first(tmp_path, monkeypatch):
    """What is refused there is opened by nobody."""
    film = tmp_path / "a.mp4"
    write_film(film)
    monkeypatch.setattr(rehearsal.subprocess, "run", lambda *_, **__: Mock(returncode=-9))
    monkeypatch.setattr(av, "open", lambda *_, **__: pytest.fail("it was opened"))
    for read in (lambda: read_sound(film), lambda: Clip(film).count):
        with pytest.raises(CaptureError) as error:
            read()
        assert error.value.code == "costly"


def test_a_film_that_takes_too_much_memory_is_not_opened(tmp_path, monkeypatch):
    """One picture takes 32 MB: FFmpeg passes over it where it is refused, and not over it here."""
    write_large(tmp_path / "a.mov", tracks=6, side=2000)
    for megabytes in (20, 60):
        monkeypatch.setattr(rehearsal, "MOST_BYTES", megabytes << 20)
        with pytest.raises(CaptureError) as error:
            open_video(tmp_path / "a.mov", 48)
        assert error.value.code == "costly", megabytes
    monkeypatch.undo()
    assert open_video(tmp_path / "a.mov", 48).width == 48


def test_a_film_that_stays_as_it_is_is_opened_apart_once(tmp_path, started):
    film = tmp_path / "a.mp4"
    write_film(film)
    for _ in range(2):
        assert len(list(open_video(film, 48).frames(25.0))) == 10
    assert len(started) == 1
    write_film(film)
    open_video(film, 48)
    assert len(started) == 2


def test_nothing_of_the_current_folder_is_run(tmp_path, started, monkeypatch):
    write_film(tmp_path / "a.mp4")
    for name in ("av", "json", "ico3d", "resource"):
        (tmp_path / f"{name}.py").write_text("open('taken', 'w')")
    monkeypatch.chdir(tmp_path)
    assert open_video(tmp_path / "a.mp4", 48).width == 64
    assert len(started) == 1 and not (tmp_path / "taken").exists()


def test_a_process_that_does_not_end_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(rehearsal, "PATIENCE", 0.01)
    write_film(tmp_path / "a.mp4")
    with pytest.raises(CaptureError) as error:
        open_video(tmp_path / "a.mp4", 48)
    assert error.value.code == "costly"


def test_a_process_that_cannot_begin_is_no_fault_of_the_film(tmp_path, monkeypatch):
    monkeypatch.setattr(rehearsal, "__name__", "ico3d.nowhere")
    write_film(tmp_path / "a.mp4")
    with pytest.raises(CaptureError, match="opened by another process first") as error:
        open_video(tmp_path / "a.mp4", 48)
    assert error.value.code == "decoding"
