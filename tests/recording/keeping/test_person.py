"""Parts while they are recorded: chunks in order, breaks, retakes, what is no video."""

import errno
import json
import os
import time
from pathlib import Path

import pytest

from ico3d.recording.keeping import person as room
from ico3d.recording.keeping.containers import suffix_of
from ico3d.recording.refusals import Refused
from support.strangers.not_ours import replacements
from support.studio_page.parts import begun, kept

WEBM = b"\x1a\x45\xdf\xa3" + bytes(60)
CROWDED = json.dumps({"seconds": 1.0, "turn": None, "advice": [[]] * 1000})
"""Of 18 reports of 60 kB, full of empty lists, a state took 0.4 s, again and again."""
MP4 = bytes(4) + b"ftypisom" + bytes(52)


@pytest.fixture
def person(tmp_path):
    return begun(tmp_path)


def _codes(act):
    with pytest.raises(Refused) as refused:
        act()
    return refused.value.code, refused.value.status


def test_chunks_follow_one_another_and_may_be_repeated(person):
    assert person.append("left", "a1", 0, WEBM) == 64
    assert person.append("left", "a1", 0, WEBM) == 64  # its answer was lost
    assert person.append("left", "a1", 64, b"more") == 68
    assert _codes(lambda: person.append("left", "a1", 70, b"x")) == ("gap", 409)
    assert person.unfinished("left", "a1").read_bytes() == WEBM + b"more"


def test_a_part_whose_page_was_closed_is_there_and_can_be_kept(person):
    person.append("text-1", "a1", 0, WEBM)
    person.append("text-1", "b2", 0, WEBM + b"longer")
    (part,) = person.parts()
    assert (part.id, part.take, part.report) == ("text-1", "b2", None)
    person.keep("text-1", "b2", {"seconds": 2.0, "turn": None, "advice": []})
    (part,) = person.parts()
    assert (part.file.name, part.take) == ("text-1.webm", "")
    assert part.report == {"seconds": 2.0, "turn": None, "advice": []}
    assert sorted(f.name for f in (person.folder / "parts").iterdir()) == [
        "text-1.json",
        "text-1.webm",
    ]


@pytest.mark.parametrize("way", ["listed before", "listed never"])
@pytest.mark.parametrize("asked", ["alone", "with all"])
def test_a_part_is_there_while_it_is_being_kept(person, monkeypatch, way, asked):
    """The page asks for all parts again and again, between any two steps of who keeps one."""
    person.append("text-1", "a1", 0, WEBM)
    listing, report = room.first_entries, {"seconds": 2.0, "turn": None, "advice": []}

    def meanwhile(*words):
        before = listing(*words)
        monkeypatch.setattr(room, "first_entries", listing)
        person.keep("text-1", "a1", report)
        return before if way == "listed before" else []

    monkeypatch.setattr(room, "first_entries", meanwhile)
    part = person.part("text-1") if asked == "alone" else next(person.parts())
    assert (part.file.name, part.report) == ("text-1.webm", report)


def test_an_earlier_take_stays_until_the_new_one_is_kept(person):
    kept(person, "left", WEBM + b"first")
    person.append("left", "b2", 0, MP4)
    assert person.part("left").file.read_bytes() == WEBM + b"first"
    person.keep("left", "b2", {"seconds": 3.0, "turn": None, "advice": []})
    assert person.part("left").file.name == "left.mp4"
    assert not (person.folder / "parts" / "left.webm").exists()
    person.remove("left")
    assert person.part("left") is None and list(person.parts()) == []


def test_what_is_no_video_is_not_even_begun(person):
    for data in (b"<html>", b"#EXTM3U\nfile:///etc/passwd", b"ffconcat version 1.0\n", b""):
        assert _codes(lambda data=data: person.append("upload", "a1", 0, data or b"x")) == (
            "no-video",
            415,
        )
    assert not (person.folder / "parts").exists()
    assert suffix_of(b"RIFF\0\0\0\0AVI LIST") == ".avi"
    assert suffix_of(b"RIFF\0\0\0\0WAVEfmt ") == ""


@pytest.mark.parametrize(
    ("id", "take"), [("../x", "a"), ("left", "../a"), ("left", ""), ("left", "a" * 33), ("x", "a")]
)
def test_only_known_parts_and_plain_takes(person, id, take):
    assert _codes(lambda: person.append(id, take, 0, WEBM)) == ("part", 404)
    assert _codes(lambda: person.unfinished(id, take)) == ("part", 404)


def test_parts_and_takes_are_bounded(person, monkeypatch):
    monkeypatch.setattr(room, "MOST_BYTES", 100)
    person.append("left", "a1", 0, WEBM)
    assert _codes(lambda: person.append("left", "a1", 64, bytes(37))) == ("large", 413)
    person.append("upload", "a1", 0, WEBM + bytes(100))  # a whole video may be larger
    for number in range(9):
        person.append("right", f"t{number}", 0, WEBM)
    assert len(list((person.folder / "parts").glob("right.*"))) == room.MOST_TAKES


def test_a_disk_that_fills_up_loses_nothing_that_was_there(person, monkeypatch):
    person.append("left", "a1", 0, WEBM)
    opened = Path.open

    class Full:
        def __init__(self, stream):
            self.stream = stream

        def __enter__(self):
            return self

        def __exit__(self, *_):
            self.stream.close()

        def write(self, data):
            self.stream.write(data[:3])
            self.stream.flush()
            raise OSError(errno.ENOSPC, "No space left on device")

        def truncate(self, size):
            self.stream.truncate(size)

    monkeypatch.setattr(Path, "open", lambda self, mode: Full(opened(self, mode)))
    with pytest.raises(OSError, match="No space"):
        person.append("left", "a1", 64, b"more")
    monkeypatch.undo()
    assert person.unfinished("left", "a1").read_bytes() == WEBM
    assert person.append("left", "a1", 64, b"more") == 68


def test_nothing_is_shown_or_written_behind_a_link(person, tmp_path):
    kept(person, "left", WEBM)
    secret = tmp_path / "secret"
    secret.write_bytes(b"secret")
    parts = person.folder / "parts"
    (parts / "text-1.webm").symlink_to(secret)
    (parts / "text-2.a1.part").symlink_to(secret)
    (parts / "text-3.a1.part").symlink_to(tmp_path / "nowhere")
    assert [part.id for part in person.parts()] == ["left"]
    for id in ("text-2", "text-3"):
        assert _codes(lambda id=id: person.append(id, "a1", 6, b"more")) == ("part", 404)
    person.remove("text-1")
    assert not (parts / "text-1.webm").is_symlink()
    assert secret.read_bytes() == b"secret"


def test_a_pipe_is_no_take(person):
    """Whoever opens one waits for ever."""
    kept(person, "left", WEBM)
    os.mkfifo(person.folder / "parts" / "text-2.a1.part")
    assert _codes(lambda: person.append("text-2", "a1", 0, WEBM)) == ("part", 404)


@pytest.mark.parametrize(
    "text",
    ["[]", "null", "{}", '{"language": "xx"}', '{"language": []}', "[" * 100_000, "1" * 5000],
)
def test_a_damaged_consent_is_one_sentence(person, text):
    (person.folder / "consent.json").write_text(text)
    assert _codes(person.consent) == ("unknown", 404)


@pytest.mark.parametrize("text", ["[]", "{}", "[" * 100_000, '{"seconds": NaN}', CROWDED])
def test_a_damaged_report_says_nothing(person, text):
    kept(person, "left", WEBM)
    (person.folder / "parts" / "left.json").write_text(text)
    (part,) = person.parts()
    assert part.report == {"seconds": 0.0, "turn": None, "advice": []}


def test_a_large_file_of_a_strangers_folder_says_nothing(person):
    """A few MB of brackets became gigabytes, again and again while the page was open."""
    kept(person, "left", WEBM, turn=0.3)
    consent, report = person.folder / "consent.json", person.folder / "parts" / "left.json"
    for file, beyond in ((report, 0), (consent, 0), (report, 1), (consent, 1)):
        file.write_bytes(file.read_bytes().rstrip().ljust((16 << 10) + beyond))
        (part,) = person.parts()
        assert (part.report == room.UNSEEN) == (beyond == 1)
        if file == report or beyond == 0:
            assert person.consent()
    assert _codes(person.consent) == ("unknown", 404)


def test_what_lies_elsewhere_is_not_read(person):
    kept(person, "left", WEBM, turn=0.3)
    about, parts = person.consent(), person.folder / "parts"
    for _ in replacements(person.folder / "consent.json"):
        assert _codes(person.consent) == ("unknown", 404)
    assert person.consent() == about
    for _ in replacements(parts / "left.json"):
        (part,) = person.parts()
        assert part.report == room.UNSEEN
    for _ in replacements(parts / "left.webm"):
        assert not list(person.parts())
    (part,) = person.parts()
    assert part.report["turn"] == 0.3


def test_thousands_of_files_are_not_looked_through(person, monkeypatch):
    """A page asks for all parts again and again: a stranger's folder held up those of others."""
    kept(person, "left", WEBM)
    for number in range(200):
        (person.folder / room.PARTS / f"right.{number}.part").touch()
    monkeypatch.setattr(room, "MOST_FILES", 50)
    listed, looked = [], []
    listing, look = room.first_entries, Path.lstat
    monkeypatch.setattr(room, "first_entries", lambda *a: listed.append(listing(*a)) or listed[-1])
    monkeypatch.setattr(Path, "lstat", lambda file: looked.append(file) or look(file))
    assert {part.id for part in person.parts()} >= {"left"}
    assert [len(entries) for entries in listed] == [50]
    assert len(looked) <= len(room.SUFFIXES) * len(room.ALL_IDS)


def test_a_crowd_hides_no_part_that_was_kept(person, monkeypatch):
    monkeypatch.setattr(room, "MOST_FILES", 5)
    (person.folder / room.PARTS).mkdir()
    for number in range(50):
        (person.folder / room.PARTS / f"x{number}").touch()
    kept(person, "consent", WEBM)
    assert [part.id for part in person.parts()] == ["consent"]
    person.check_spoken()


def test_of_a_part_all_files_go_and_nothing_that_was_recorded_anew(person, monkeypatch):
    parts = person.folder / room.PARTS
    kept(person, "left", WEBM)
    kept(person, "right", WEBM)
    for number in range(20):
        (parts / f"left.{number}.part").touch()
    (parts / "left.folder").mkdir()
    (parts / "left.mp4.link").symlink_to(parts / "right.webm")
    assert person.remove("left") is False  # all of it was looked at
    assert {file.name for file in parts.iterdir()} == {"right.webm", "right.json", "left.folder"}
    for number in range(20):
        (parts / f"left.{number}.part").touch()
    monkeypatch.setattr(room, "MOST_FILES", 5)
    assert person.remove("left") is True
    until = max(file.stat().st_ctime for file in parts.iterdir())
    while time.time() <= until + 0.01:  # a clock tick of the file system
        time.sleep(0.01)
    kept(person, "left", WEBM)
    person.remove_rest("left", until)
    left = {"left.webm", "left.json"}
    assert {file.name for file in parts.glob("left.*")} == left | {"left.folder"}
