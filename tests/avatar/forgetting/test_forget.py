"""`ico3d forget`: a project of two people, of which one goes."""

import fcntl
import json
import os
import sys
import time
import tracemalloc
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from ico3d.avatar.forgetting import holdings
from ico3d.avatar.forgetting.choosing import (
    ELSEWHERE,
    belonging,
    outermost,
    remaining,
    within,
)
from ico3d.avatar.forgetting.holdings import Holding
from ico3d.avatar.forgetting.removal import remove
from ico3d.bundle.archive import write_zip
from ico3d.bundle.format import write_bundle
from ico3d.bundle.people.provenance import Provenance
from ico3d.cli import main
from ico3d.common.files import MOST_ABOUT
from support.bundles.random_bundle import random_files, random_head, random_manifest
from support.recordings.multiview_folders import entry, ring, write_cameras


def recording(folder: Path, **stated: str) -> Path:
    folder.mkdir(parents=True)
    write_cameras(folder, [entry(camera) for camera in ring(2)], 3, **stated)
    (folder / "tracking.safetensors").write_bytes(b"a track")
    return folder


def model(folder: Path, about: str = "", summary: dict | None = None, **made_of: Path) -> Path:
    folder.mkdir(parents=True)
    run = {name: str(path) for name, path in made_of.items()}
    (folder / "settings.json").write_text(json.dumps(run | {"seed": 0}))
    if about:
        (folder / about).write_text(json.dumps({"summary": summary or {}}))
    return folder


def bundle(path: Path, likeness: str, kind: str = "portrait") -> Path:
    head = random_head(10)
    provenance = Provenance(kind, ("it",), "agreed", "CC0-1.0", likeness)
    manifest = replace(random_manifest(head), provenance=provenance)
    write_bundle(path, manifest, random_files(head))
    return path


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Ada's and Bob's recordings, and what was made of them."""
    work = tmp_path / "work"
    face = recording(work / "captures/face", likeness="Ada", sources=["ada.mp4"])
    hall = recording(work / "captures/hall", likeness="Ada")
    bob = recording(work / "captures/bob", likeness="Bob")
    head = model(work / "models/head", "head.json", capture=face)  # of an earlier version
    model(
        work / "models/ada", "avatar.json", {"body": {"likeness": "Ada"}}, capture=hall, head=head
    )
    model(work / "models/ada/body/0000", capture=hall)
    model(work / "models/tried", capture=face)
    model(work / "models/bob", "head.json", {"capture": {"likeness": "Bob"}}, capture=bob)
    model(work / "models/bob/windows/0000", capture=bob)
    bundle(work / "ada.ico3d", "Ada")
    bundle(work / "bob.ico3d", "Bob")
    bundle(work / "iris.ico3d", "not stated", "synthetic")
    bundle(work / "old.ico3d", "not stated")
    (work / "ada.mp4").write_bytes(b"a film")
    (work / ".git").mkdir()
    bundle(work / ".git/ada.ico3d", "Ada")
    monkeypatch.chdir(work)
    return work


def there(project: Path) -> set[str]:
    names = ("captures/*", "models/*", "*.ico3d", "*.mp4")
    return {str(path.relative_to(project)) for name in names for path in project.glob(name)}


OTHERS = {"captures/bob", "models/bob", "bob.ico3d", "iris.ico3d", "old.ico3d"}


def test_all_that_shows_a_person_goes_and_nothing_else(project, capsys):
    assert main(["forget", "ada", "--yes"]) == 0
    assert there(project) == OTHERS | {"ada.mp4"}
    assert (project / "models/bob/windows/0000/settings.json").is_file()
    listed, _, remaining = capsys.readouterr().out.partition("6 removed. What may remain")
    assert f"{project}/captures/face: a recording of Ada" in listed
    assert f"{project}/models/head: a model\n" in listed
    assert f"{project}/models/ada: a model, an unfinished training of Ada" in listed
    assert "- what a recording was made from: ada.mp4" in remaining
    assert (
        f"- {project}/old.ico3d, a bundle that does not say whom it shows: look at it" in remaining
    )
    assert "bob" not in remaining and "iris" not in remaining
    for elsewhere in ("bundles that were served", "films", "backups", "voices"):
        assert elsewhere in remaining


def test_a_path_stands_for_the_person_and_for_itself(project):
    assert main(["forget", "captures/face", "ada.mp4", "old.ico3d", "--yes"]) == 0
    assert there(project) == OTHERS - {"old.ico3d"}


def test_a_model_that_states_nothing_takes_along_what_was_made_of_it(project, capsys):
    assert main(["forget", "models/head", "--yes"]) == 0
    gone = {"models/head", "models/ada"}
    assert there(project) == (OTHERS | SHOWING_ADA) - gone
    assert f"- {project}/captures/face, of which something was made" in capsys.readouterr().out


SHOWING_ADA = {
    "captures/face",
    "captures/hall",
    "models/head",
    "models/ada",
    "models/tried",
    "ada.ico3d",
    "ada.mp4",
}


def test_an_avatar_of_two_people_does_not_take_the_other_along(project):
    both = model(
        project / "models/both",
        "avatar.json",
        {"head": {"likeness": "Ada"}, "body": {"likeness": "Bob"}},
        capture=project / "captures/bob",
    )
    assert main(["forget", "models/both", "--yes"]) == 0
    assert there(project) == OTHERS | SHOWING_ADA
    both = model(both, "avatar.json", {"head": {"likeness": "Ada; Bob"}}, capture=project / "x")
    assert main(["forget", "Bob", "--yes"]) == 0
    assert there(project) == (OTHERS | SHOWING_ADA) - {"captures/bob", "models/bob", "bob.ico3d"}


@pytest.mark.parametrize("word", ["JOSÉ", "Jose\u0301", "josé"])
@pytest.mark.parametrize("stated", ["José", "Jose\u0301", "JOSE\u0301 "])
def test_a_name_is_found_however_it_is_written(tmp_path, word, stated):
    bundle(tmp_path / "a.ico3d", stated)
    assert main(["forget", word, "--project", str(tmp_path), "--yes"]) == 0
    assert not list(tmp_path.iterdir())


def test_a_bundle_is_found_whatever_its_file_is_called(project):
    for name in ("copy.zip", "copy.ICO3D", "copy", "copy.ico3d.bak"):
        bundle(project / name, "Ada")
    others = {project / "bob.zip", project / "other.zip", project / "damaged.zip"}
    bundle(project / "bob.zip", "Bob")
    write_zip(project / "other.zip", {"manifest.json": b'{"name": "Ada"}'})
    (project / "damaged.zip").write_bytes(b"PK\3\4")
    os.mkfifo(project / "pipe")
    assert main(["forget", "Ada", "--yes"]) == 0
    assert not list(project.glob("copy*")) and others < set(project.iterdir())


def test_what_create_left_on_the_way_is_found_by_name_and_with_the_bundle(project, capsys):
    for words in (["Ada"], ["ada.ico3d"]):
        bundle(project / "ada.ico3d", "Ada")
        places = project / "Ada.work", project / "Bob.work", project / "renamed"
        for place in places:
            (place / ".capture-fine.abc").mkdir(parents=True, exist_ok=True)
            (place / ".capture-fine.abc" / "0.jpg").touch()
            (place / "about.json").write_text('{"video": "ada.mp4", "sha256": "0"}')
        assert main(["forget", *words, "--yes"]) == 0
        assert [place.exists() for place in places] == [False, True, True]
        said = capsys.readouterr().out
        assert f"{places[0]}: a workplace of Ada" in said
        assert f"- {places[2]}, a workplace that does not say whom it shows: look at it" in said


def test_what_a_killed_recording_left_is_found_by_name(project, capsys):
    ada, bob = project / "captures/.me.0123abcd", project / "captures/.bob.0123abcd"
    nameless, complete = project / ".old.0123abcd", project / ".late.0123abcd"
    for folder, name in ((ada, "Ada"), (bob, "Bob")):
        folder.mkdir()
        (folder / "0.jpg").touch()
        (folder / "unfinished.json").write_text(json.dumps({"likeness": name, "sources": ["a"]}))
    nameless.mkdir()
    recording(complete, likeness="Ada")
    recording(project / ".hidden", likeness="Ada")
    assert main(["forget", "Ada", "--yes"]) == 0
    left = [one.exists() for one in (ada, bob, nameless, complete, project / ".hidden")]
    assert left == [False, True, True, False, True]
    said = capsys.readouterr().out
    assert f"{ada}: an unfinished recording of Ada" in said
    assert f"- {nameless}, an unfinished recording that does not say whom it shows" in said


def test_links_go_and_what_they_lead_to_is_named(project, tmp_path, capsys):
    elsewhere = recording(tmp_path / "archive", likeness="Ada")
    (project / "captures/linked").symlink_to(elsewhere)
    assert main(["forget", "Ada", "--yes"]) == 0
    assert there(project) == OTHERS | {"ada.mp4"} and (elsewhere / "cameras.json").is_file()
    said = capsys.readouterr().out
    assert f"- {elsewhere}, to which {project}/captures/linked led" in said


def test_many_links_to_one_place_are_looked_at_once(project, tmp_path, monkeypatch):
    """Each look reads files that may be large."""
    elsewhere, looked = recording(tmp_path / "archive", likeness="Ada"), []
    for number in range(5):
        (project / f"captures/linked{number}").symlink_to(elsewhere)
    real = holdings.read_object
    monkeypatch.setattr(holdings, "read_object", lambda file: looked.append(file) or real(file))
    assert main(["forget", "Ada", "--yes"]) == 0
    assert there(project) == OTHERS | {"ada.mp4"}
    assert len([file for file in looked if file.parent.name.startswith("linked")]) == 1


def test_no_large_file_is_taken_for_what_says_whose_something_is(tmp_path):
    """Parsed, it would take forty times its size, and as a link as often as there are names."""
    (tmp_path / "a").mkdir()
    (tmp_path / "a/avatar.json").write_text('{"a": [' + "[]," * (MOST_ABOUT // 3) + "0]}")
    for name in ("body.json", "head.json", "settings.json"):
        (tmp_path / "a" / name).symlink_to("avatar.json")
    tracemalloc.start()
    assert holdings.find_holdings(tmp_path) == []
    assert tracemalloc.get_traced_memory()[1] < 4 * MOST_ABOUT
    tracemalloc.stop()


LOCKED = {
    "a training": "models/tried/settings.json",
    "a training within": "models/ada/body/0000/settings.json",
    "ico3d create": "captures/face/lock",
    "a recording": "captures/hall",
}


@pytest.mark.parametrize("name", LOCKED.values(), ids=LOCKED)
def test_what_somebody_works_at_is_not_removed(project, capsys, name):
    """They would write there again, and nobody would know whose it is."""
    file = project / name
    if not file.exists():
        file.touch()
    opened = os.open(file, os.O_RDONLY)
    fcntl.flock(opened, fcntl.LOCK_EX)
    before = there(project)
    assert main(["forget", "Ada", "--yes"]) == 1
    place = file if file.is_dir() else file.parent
    assert f"a process works at {place} just now" in capsys.readouterr().err
    assert there(project) == before
    os.close(opened)
    assert main(["forget", "Ada", "--yes"]) == 0
    assert there(project) == OTHERS | {"ada.mp4"}


def test_damaged_things_are_no_obstacle(project):
    (project / "captures/hall/cameras.json").write_text("{")
    (project / "old.ico3d").write_bytes(b"no bundle")
    assert main(["forget", "Ada", "captures/hall", "--yes"]) == 0
    assert there(project) == OTHERS | {"ada.mp4"}


def test_nothing_goes_before_somebody_agrees(project, monkeypatch, capsys):
    assert main(["forget", "Ada"]) == 1
    assert "nothing was removed: agree to it with --yes." in capsys.readouterr().err
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr("rich.prompt.Confirm.ask", lambda *_, **__: False)
    assert main(["forget", "Ada"]) == 1
    assert there(project) == OTHERS | SHOWING_ADA
    monkeypatch.setattr("rich.prompt.Confirm.ask", lambda *_, **__: True)
    assert main(["forget", "Ada"]) == 0
    assert there(project) == OTHERS | {"ada.mp4"}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "needs a person's name"),
        (["Eve"], "is the likeness of Eve; stated are: Ada, Bob. Name paths"),
        (["captures/eve"], "there is nothing at captures/eve."),
        (["."], "does not lie below"),
        (["../other"], "does not lie below"),
        (["captures/bob", "--project", "models"], "does not lie below"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(project, capsys, words, sentence):
    (project.parent / "other").mkdir()
    assert main(["forget", *words, "--yes"]) == 1
    assert sentence in capsys.readouterr().err
    assert there(project) == OTHERS | SHOWING_ADA


def test_what_cannot_be_removed_is_named(project, monkeypatch, capsys):
    unlink = os.unlink

    def fail(path, **more):
        if str(path).endswith("tracking.safetensors"):
            raise PermissionError(13, "Permission denied")
        unlink(path, **more)

    monkeypatch.setattr("os.unlink", fail)
    assert main(["forget", "captures/face", "ada.ico3d", "--yes"]) == 1
    assert [file.name for file in (project / "captures/face").iterdir()] == ["tracking.safetensors"]
    assert f"{project}/captures/face (Permission denied)" in capsys.readouterr().err
    assert "ada.ico3d" not in there(project)


def test_what_vanishes_meanwhile_does_not_save_the_rest(project, monkeypatch):
    unlink = os.unlink

    def vanish(path, **more):
        unlink(path, **more)
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr("os.unlink", vanish)
    remove([project / "captures/face"])
    assert not (project / "captures/face").exists()


def test_what_the_studio_page_recorded_is_found_by_name(project):
    folder = project / "recordings" / "Ada"
    (folder / "parts").mkdir(parents=True)
    (folder / "parts" / "text-1.webm").write_bytes(b"a film")
    (folder / "consent.json").write_text(json.dumps({"likeness": "Ada", "sources": []}))
    bundle(folder / "Ada.ico3d", "Ada")
    assert main(["forget", "Ada", "--yes"]) == 0
    assert not folder.exists()


def test_a_strangers_folder_does_not_keep_anybody_from_being_forgotten(tmp_path, capsys):
    work = tmp_path / "work"
    ada = bundle_in(work / "a", "Ada")
    stranger = model(work / "b")
    (stranger / "settings.json").write_text("[" * 100_000)
    (model(work / "c") / "head.json").write_text('{"summary": 3}')
    (model(work / "d") / "head.json").symlink_to("/dev/zero")
    assert main(["forget", "Ada", "--project", str(work), "--yes"]) == 0
    assert not ada.exists() and stranger.exists()


def test_a_terminal_obeys_nothing_that_a_bundle_says(tmp_path, capsys):
    bundle_in(tmp_path / "a", "Ada\x1b[2J\x1b[8m")
    said = ["forget", str(tmp_path / "a/a.ico3d"), "--project", str(tmp_path)]
    assert main(said) == 1
    printed = capsys.readouterr().out
    assert printed == f"{tmp_path}/a/a.ico3d: a bundle of Ada\\x1b[2J\\x1b[8m\n"


def bundle_in(folder: Path, likeness: str) -> Path:
    folder.mkdir(parents=True)
    return bundle(folder / "a.ico3d", likeness)


def test_a_chain_of_thousands_of_models_takes_seconds_not_days(tmp_path):
    """Each was made of the next one, of which the last one shows somebody."""
    paths = [tmp_path / f"{number:04}" for number in range(3000)]
    chain = [Holding(path, "a model", (), (origin,)) for path, origin in pairwise(paths)]
    links = [*chain, Holding(paths[-1], "a model", ("Eve",)), Holding(tmp_path / "b", "", ())]
    begin = time.process_time()
    chosen = belonging(links, [], {"eve"})
    assert [one.path for one in chosen] == paths == outermost(paths)
    assert len(within(paths, chosen)) == len(paths)
    assert len(list(remaining(links, chosen, paths))) == 1 + len(ELSEWHERE)
    assert time.process_time() - begin < 2


def test_a_model_of_an_endless_path_is_nobodys(project, capsys):
    model(
        project / "models/odd",
        "head.json",
        {"capture": {"likeness": "Ada"}},
        capture=Path("a" * 300),
    )
    main(["forget", "Ada", "--project", str(project), "--yes"])
    assert "removed" in capsys.readouterr().out
