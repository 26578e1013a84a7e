"""`ico3d forget` where strangers' folders lie beside what is to go, and in it."""

import os

import pytest

from ico3d.avatar.forgetting import removal
from ico3d.avatar.forgetting.holdings import ABOUT, RECORDINGS, RUN
from ico3d.avatar.forgetting.removal import links_in, remove
from ico3d.bundle.manifest import MANIFEST
from ico3d.cli import main
from support.recordings.multiview_folders import entry, ring, write_cameras
from support.strangers.links import ODD_LINKS, odd_link
from support.strangers.nested import nested


def recording(folder):
    folder.mkdir()
    write_cameras(folder, [entry(camera) for camera in ring(2)], 3, likeness="Ada")
    return folder


def forget(project):
    return main(["forget", "Ada", "--project", str(project), "--yes"])


@pytest.mark.parametrize("kind", ODD_LINKS)
def test_links_are_no_obstacle(tmp_path, kind):
    ours = recording(tmp_path / "ours")
    for mark in (*RECORDINGS, MANIFEST, ABOUT, RUN, "b.ico3d"):
        (tmp_path / f"of {mark}").mkdir()
        odd_link(tmp_path / f"of {mark}" / mark, kind)
    odd_link(ours / "link", kind)
    assert forget(tmp_path) == 0
    assert not ours.exists()


def test_folders_nested_deep_are_no_obstacle(tmp_path):
    ours = recording(tmp_path / "ours")
    with nested(tmp_path):
        assert forget(tmp_path) == 0
        assert not ours.exists()
        assert main(["forget", str(tmp_path / "d"), "--project", str(tmp_path), "--yes"]) == 0
    assert list(tmp_path.iterdir()) == []


def test_a_link_that_nobody_may_read_is_removed(tmp_path, monkeypatch):
    """As `/proc/1/cwd`, of whoever owns that process."""
    ours = recording(tmp_path / "ours")
    (ours / "link").symlink_to("/nowhere")

    def refuse(path, **_):
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(os, "readlink", refuse)
    assert links_in([ours]) == [f"{ours}/link, to which {ours}/link led"]
    remove([ours])
    assert not ours.exists()


def test_of_many_links_some_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr(removal, "MOST_TOLD", 2)
    for number in range(4):
        (tmp_path / str(number)).symlink_to("/elsewhere")
    told = links_in([tmp_path])
    assert len(told) == 3 and told[0].startswith("/elsewhere, to which ")
    assert told[-1] == "what further links led to"
    assert len(links_in([tmp_path / "0", tmp_path / "1"])) == 2


def test_what_was_being_removed_is_known_by_its_name(tmp_path, capsys):
    left = tmp_path / "people" / ".Ada.0123456789abcdef.gone"
    (left / "parts").mkdir(parents=True)
    (tmp_path / "people" / ".Ada.fedcba9876543210.gone").write_bytes(b"a film")
    (tmp_path / "people" / ".Bob.0123456789abcdef.gone").mkdir()
    assert forget(tmp_path) == 0
    assert [path.name for path in (tmp_path / "people").iterdir()] == [".Bob.0123456789abcdef.gone"]
    assert f"{left}: what is left of a removal of Ada" in capsys.readouterr().out
