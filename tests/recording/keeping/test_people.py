"""Whose recordings there are: names, consent, room on the disk, and that deleting is deleting."""

import contextlib
import errno
import json
import os
import stat
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest

from ico3d.bundle.people.provenance import Provenance
from ico3d.common.people.stated import is_stated
from ico3d.errors import SettingsError, StorageError
from ico3d.recording.keeping import people as room
from ico3d.recording.keeping.people import People
from ico3d.recording.refusals import Refused
from support.strangers.links import ODD_LINKS, odd_link
from support.strangers.nested import nested
from support.studio_page.parts import DAY, begun, kept

WEBM = b"\x1a\x45\xdf\xa3" + bytes(60)


def test_consent_is_written_as_bundles_state_it(tmp_path):
    person = begun(tmp_path)
    stated = json.loads((tmp_path / "Ida" / "consent.json").read_text("utf-8"))
    assert stated.pop("language") == "en"
    about = Provenance(**(stated | {"sources": tuple(stated["sources"])}))
    assert about.likeness == about.made_by == "Ida" and is_stated(about.consent)
    assert about.consent.startswith("agreed on 2026-11-24, ticked: “I am Ida. I agree")
    assert (about.kind, about.licence) == ("portrait", "for this person's own use")
    kept(person, "consent", WEBM)
    assert person.consent()["consent"].startswith("agreed on 2026-11-24, ticked and spoken: “I")
    kept(person, "consent", WEBM)
    assert person.consent()["consent"].count("spoken") == 1
    person.remove("consent")
    assert person.consent()["consent"] == about.consent


def test_a_voice_has_a_consent_of_its_own(tmp_path):
    assert "voice_consent" not in begun(tmp_path).consent()
    person = People(tmp_path).begin("Ada", "de", True, DAY, voice=True)
    said = "“Ich bin auch einverstanden, dass der Avatar mit einer Nachahmung meiner Stimme spricht"
    assert person.consent()["voice_consent"].startswith(f"agreed on 2026-11-24, ticked: {said}")
    kept(person, "consent", WEBM)
    spoken = f"agreed on 2026-11-24, ticked and spoken: {said}"
    assert person.consent()["voice_consent"].startswith(spoken)
    assert "Stimme" not in person.consent()["consent"]


@pytest.mark.parametrize(
    "name",
    [
        "",
        " ",
        "..",
        "../x",
        "a/b",
        "a\\b",
        ".x",
        "-x",
        "x" * 41,
        "x.y",
        "x\0",
        "1a",
        "a\nb",
        "\u0301a",
    ],
)
def test_names_that_lead_elsewhere_are_none(tmp_path, name):
    people = People(tmp_path / "in")
    for act in (lambda: people.begin(name, "en", True, DAY), lambda: people.person(name)):
        with pytest.raises(Refused) as refused:
            act()
        assert refused.value.code == "name"
    assert [path.name for path in tmp_path.rglob("*")] == ["in"]


def test_names_of_all_scripts_are_kept(tmp_path):
    names = ["Zoë", "李雷", "José Núñez", "Anne-Marie 2", "प्रिया", "தமிழ்", "ภูมิ"]
    for name in names:
        assert begun(tmp_path, name).name == name
    assert sorted(People(tmp_path).names()) == sorted(names)


@pytest.mark.parametrize(
    ("name", "language", "agreed", "code"),
    [
        ("Ada", "en", False, "consent"),
        ("Ada", "xx", True, "language"),
        ("Ida", "en", True, "taken"),
    ],
)
def test_without_consent_nothing_begins(tmp_path, name, language, agreed, code):
    begun(tmp_path)
    with pytest.raises(Refused) as refused:
        People(tmp_path).begin(name, language, agreed, DAY)
    assert refused.value.code == code and People(tmp_path).names() == ["Ida"]


def test_of_those_who_begin_at_once_under_one_name_one_does(tmp_path, monkeypatch):
    people, together = People(tmp_path), threading.Barrier(2)

    @contextlib.contextmanager
    def both(_):  # the last look before
        together.wait(5)
        yield

    monkeypatch.setattr(people, "room_for", both)

    def begin(voice):
        try:
            return people.begin("Ida", "en", True, DAY, voice).consent()
        except Refused as refused:
            return refused.code

    with ThreadPoolExecutor(2) as threads:
        ends = list(threads.map(begin, (True, False)))
    assert ends.count("taken") == 1 and people.person("Ida").consent() in ends


def test_a_name_is_free_after_a_disk_that_was_full(tmp_path, monkeypatch):
    def full(*_):
        raise StorageError("the disk is full.")

    monkeypatch.setattr(room, "write_atomic", full)
    with pytest.raises(StorageError):
        begun(tmp_path)
    monkeypatch.undo()
    assert begun(tmp_path).name == "Ida"


def test_a_folder_holds_so_many_people_and_a_disk_so_much(tmp_path, monkeypatch):
    begun(tmp_path)
    monkeypatch.setattr(room, "MOST", 1)
    with pytest.raises(Refused, match="100 people"):
        begun(tmp_path, "Ada")
    monkeypatch.setattr(room, "MOST", 2)
    monkeypatch.setattr(room.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 1e8}))
    with pytest.raises(Refused, match="the disk is full") as refused:
        begun(tmp_path, "Ada")
    assert refused.value.status == 507 and People(tmp_path).names() == ["Ida"]


def test_what_others_are_writing_counts_as_written(tmp_path, monkeypatch):
    monkeypatch.setattr(room.shutil, "disk_usage", lambda _: SimpleNamespace(free=room.SPARE + 30))
    people = People(tmp_path)
    with people.room_for(20):
        with pytest.raises(Refused, match="the disk is full"), people.room_for(20):
            pass
        with people.room_for(10):
            pass
    with people.room_for(30):
        pass


def test_delete_leaves_nothing_and_nobody_else_loses_anything(tmp_path):
    ida, ada = begun(tmp_path), begun(tmp_path, "Ada")
    kept(ida, "consent", WEBM)
    (ida.folder / "making" / "Ida.work").mkdir(parents=True)
    (ida.folder / "making" / "Ida.work" / "lock").touch()
    (ida.folder / "Ida.ico3d").write_bytes(b"avatar")
    People(tmp_path).delete("Ida")
    assert list(tmp_path.iterdir()) == [ada.folder]
    with pytest.raises(Refused, match="nothing is recorded of Ida"):
        People(tmp_path).person("Ida")


def test_a_removal_that_was_killed_is_ended_at_the_next_start(tmp_path, monkeypatch):
    ida = begun(tmp_path)
    kept(ida, "consent", WEBM)
    monkeypatch.setattr(room, "remove", lambda paths: None)
    People(tmp_path).delete("Ida")
    monkeypatch.undo()
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(".") and (left / "parts" / "consent.webm").is_file()
    others = begun(tmp_path, "Ida"), (tmp_path / ".git"), (tmp_path / ".Ida.gone")
    for other in others[1:]:
        other.mkdir()
    People(tmp_path).clear()
    assert {path.name for path in tmp_path.iterdir()} == {"Ida", ".git", ".Ida.gone"}


def test_what_cannot_be_removed_is_named(tmp_path, monkeypatch):
    begun(tmp_path)

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.rename", refuse)
    with pytest.raises(SettingsError, match=r"Ida cannot be removed \(Permission denied\)"):
        People(tmp_path).delete("Ida")
    assert People(tmp_path).names() == ["Ida"]


def test_a_link_to_elsewhere_is_nobody(tmp_path):
    begun(tmp_path / "other")
    People(tmp_path / "mine")
    (tmp_path / "mine" / "Ida").symlink_to(tmp_path / "other" / "Ida")
    with pytest.raises(Refused):
        People(tmp_path / "mine").delete("Ida")
    assert (tmp_path / "other" / "Ida" / "consent.json").is_file()


@pytest.mark.parametrize("place", ["consent.json", "parts", "making"])
def test_whose_files_lie_behind_a_link_is_nobody_and_is_not_named(tmp_path, place):
    ada, ida = begun(tmp_path, "Ada"), begun(tmp_path, "Ida")
    elsewhere = tmp_path / "elsewhere"
    if (ida.folder / place).exists():
        (ida.folder / place).rename(elsewhere)
    else:
        elsewhere.mkdir()
    (ida.folder / place).symlink_to(elsewhere)
    assert People(tmp_path).names() == [ada.name]
    with pytest.raises(Refused, match="nothing is recorded of Ida"):
        People(tmp_path).person("Ida")


@pytest.mark.parametrize("kind", ODD_LINKS)
def test_a_link_that_cannot_be_followed_hides_nobody_else(tmp_path, kind):
    ada = begun(tmp_path, "Ada")
    (tmp_path / "Bob").mkdir()
    odd_link(tmp_path / "Bob" / "consent.json", kind)
    (tmp_path / "Eve").symlink_to("Eve" if kind == "itself" else "e" * 300)
    people = People(tmp_path)
    assert people.names() == ["Ada"]
    for name in ("Bob", "Eve"):
        with pytest.raises(Refused, match="nothing is recorded"):
            people.person(name)
    odd_link(ada.folder / "link", kind)
    left = tmp_path / ".Ida.0123456789abcdef.gone"
    left.mkdir()
    odd_link(left / "link", kind)
    people.clear()
    people.delete("Ada")
    assert {path.name for path in tmp_path.iterdir()} == {"Bob", "Eve"}


def test_who_is_nested_deep_is_deleted(tmp_path):
    ida = begun(tmp_path)
    kept(ida, "consent", WEBM)
    people = People(tmp_path)
    with nested(ida.folder / "parts"):
        people.delete("Ida")
        people.close()  # on a busy machine it takes more than the second that is waited for
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_was_spelled_elsewhere_is_found(tmp_path):
    begun(tmp_path, "Zoë").folder.rename(tmp_path / "Zoe\u0308")
    people = People(tmp_path)
    (name,) = people.names()
    assert people.person(name).consent()["language"] == "en"
    people.delete(name)
    assert people.names() == []


def test_nobody_waits_for_the_removal_of_another_one(tmp_path, monkeypatch):
    held, gone = threading.Event(), []

    def slow(paths):
        assert held.wait(20)
        gone.extend(paths)

    for name in ("Ada", "Ida", "Eve"):
        begun(tmp_path, name)
    people = People(tmp_path)
    monkeypatch.setattr(room, "remove", slow)
    monkeypatch.setattr(room, "PATIENCE", 0.2)
    monkeypatch.setattr(room, "LAST", 0.1)
    people.delete("Ada")
    begin = time.monotonic()
    people.delete("Ida")
    people.delete("Eve")
    assert time.monotonic() - begin < 0.15 and people.names() == []
    people.close()
    assert not gone
    held.set()
    monkeypatch.setattr(room, "LAST", 10)
    people.close()  # an end waits for what is nearly done
    assert {path.name.split(".")[1] for path in gone} == {"Ada", "Ida", "Eve"}


def test_of_a_folder_of_thousands_some_are_looked_at(tmp_path, monkeypatch):
    begun(tmp_path)
    people = People(tmp_path)
    looked = []
    monkeypatch.setattr(room, "MOST_ENTRIES", 20)
    monkeypatch.setattr(People, "_is_here", lambda self, name: looked.append(name) or False)
    for number in range(100):
        (people.folder / f"n{number}").mkdir()
    assert people.names() == [] and len(looked) <= 20


@pytest.mark.parametrize("odd", ["link", "folder", "pipe", "full"])
def test_no_strangers_lock_keeps_the_server_from_starting(tmp_path, monkeypatch, caplog, odd):
    lock, elsewhere = tmp_path / room.LOCK, tmp_path / "elsewhere"
    elsewhere.write_text("theirs")
    if odd == "link":
        lock.symlink_to(elsewhere)
    elif odd == "folder":
        lock.mkdir()
    elif odd == "pipe":
        os.mkfifo(lock)
    else:
        full = OSError(errno.ENOSPC, "No space left on device")
        monkeypatch.setattr(room, "own_file", lambda file: (_ for _ in ()).throw(full))
    with room.held(tmp_path):
        assert "Another studio may serve" in caplog.text
    assert elsewhere.read_text() == "theirs"


def test_nobody_else_on_the_machine_can_hold_the_lock(tmp_path):
    with room.held(tmp_path), pytest.raises(SettingsError, match="served by another"):
        room.held(tmp_path)
    assert stat.S_IMODE((tmp_path / room.LOCK).stat().st_mode) == 0o600
    room.held(tmp_path).close()
    assert People(tmp_path).names() == []
