"""Servers of finished avatars: one for each, ended when they are to end."""

import os
import sys
import threading
import time

import pytest

from ico3d.recording import beside
from ico3d.recording.making import talks
from ico3d.recording.making.talks import Talks
from ico3d.recording.refusals import Refused


@pytest.fixture
def avatar(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))  # of the tests
    monkeypatch.setattr(talks, "TALK", "support.studio_page.pretended_talk")
    file = tmp_path / "Ida.ico3d"
    file.write_text("Ida")
    return file


def test_an_avatar_has_one_server_until_it_is_stopped(avatar):
    serving = Talks("127.0.0.1", False)
    url = serving.begin(avatar).url()
    assert url.startswith("http://127.0.0.1:") and url.endswith("/#key=a-b")
    assert serving.begin(avatar).url() == url
    serving.stop("Ida")
    assert serving.begin(avatar).url() != url
    process = serving._running["Ida"].process
    serving.close()
    assert process.poll() is not None


def test_few_talk_at_once_and_the_one_asked_for_longest_ago_ends(avatar, monkeypatch):
    monkeypatch.setattr(talks, "MOST", 2)
    serving, files = Talks("127.0.0.1", False), [avatar]
    for name in ("Ada", "Eve"):
        files.append(avatar.with_name(f"{name}.ico3d"))
        files[-1].write_text(name)
    urls = [serving.begin(file).url() for file in files[:2]]
    assert serving.begin(avatar).url() == urls[0]  # is asked for again
    ada, ida = (serving._running[name].process for name in ("Ada", "Ida"))
    serving.begin(files[2]).url()
    assert list(serving._running) == ["Ida", "Eve"]
    assert ada.poll() is not None and ida.poll() is None
    serving.close()


def test_a_talk_that_speaks_on_is_ended_and_holds_up_nobody(avatar, monkeypatch):
    serving, slow = Talks("127.0.0.1", False), avatar.with_name("Slow.ico3d")
    slow.write_text("Stubborn")
    serving.begin(slow).url()
    url = serving.begin(avatar).url()
    process = serving._running["Slow"].process
    monkeypatch.setattr(talks, "PATIENCE", 20.0)
    ending = threading.Thread(target=serving.stop, args=["Slow"], daemon=True)
    ending.start()
    while "Slow" in serving._running:
        time.sleep(0.01)
    assert serving.begin(avatar).url() == url and process.poll() is None
    monkeypatch.setattr(talks, "PATIENCE", 0.2)
    serving.begin(slow).url()
    second = serving._running["Slow"].process
    serving.close()
    assert second.poll() is not None and process.poll() is None
    process.kill()
    ending.join()


def test_while_one_starts_others_begin_and_end_and_it_can_be_ended(avatar):
    serving, late = Talks("127.0.0.1", False), avatar.with_name("Late.ico3d")
    late.write_text("Late")  # never tells its address
    starting = serving.begin(late)
    assert serving.begin(avatar).url().startswith("http://127.0.0.1:")
    serving.stop("Ida")
    assert starting.process.poll() is None
    serving.stop("Late")
    assert starting.process.poll() is not None
    with pytest.raises(Refused, match="cannot talk"):
        starting.url()


def test_no_talk_stays_of_an_avatar_that_was_deleted_as_it_began(avatar, monkeypatch):
    started = []

    def start(*words):
        avatar.unlink()  # and whoever does so has stopped its talk before this one is known
        started.append(beside.start(*words))
        return started[0]

    monkeypatch.setattr(talks, "start", start)
    serving = Talks("127.0.0.1", False)
    with pytest.raises(Refused, match="not made"):
        serving.begin(avatar)
    assert not serving._running and started[0].poll() is not None


def test_a_name_is_no_address(avatar):
    """That of a stranger's bundle is printed before the address of its server."""
    avatar.write_text("Ida is at http://203.0.113.7:9/#key=mine (Ctrl+C ends)")
    serving = Talks("127.0.0.1", False)
    assert serving.begin(avatar).url().startswith("http://127.0.0.1:")
    serving.close()


def test_what_is_not_made_or_does_not_start_is_said(avatar, tmp_path):
    serving = Talks("127.0.0.1", False)
    with pytest.raises(Refused, match="not made yet"):
        serving.begin(tmp_path / "Ada.ico3d").url()
    avatar.write_bytes(b"")
    with pytest.raises(Refused, match="cannot talk"):
        serving.begin(avatar).url()
