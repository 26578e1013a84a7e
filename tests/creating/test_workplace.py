import os

import numpy as np
import pytest
from PIL import Image

from ico3d.avatar.baking.command import _save_picture
from ico3d.creating.events import Preview
from ico3d.creating.settings import CreateSettings
from ico3d.creating.telling import Terminal
from ico3d.creating.workplace import workplace
from ico3d.errors import CaptureError, SettingsError, StorageError
from ico3d.training.listing.find_runs import find_runs
from ico3d.training.notes.state import carried_out


@pytest.fixture
def settings(tmp_path):
    (tmp_path / "me.mp4").write_bytes(b"a video")
    return CreateSettings(tmp_path / "me.mp4", tmp_path / "me.ico3d", consent="I agree")


def _other(settings, **changes):
    return CreateSettings(**{**vars(settings), **changes})


def _refused(settings, error, sentence):
    with pytest.raises(error, match=sentence), workplace(settings):
        pass


def test_one_process_at_a_time(settings):
    with workplace(settings) as place:
        _refused(settings, SettingsError, "is being made just now")
    with workplace(settings) as again:
        assert again == place


def test_what_a_killed_process_left_is_cleared_and_the_rest_kept(settings):
    with workplace(settings) as place:
        left = place.folder / ".capture-exact.abc" / "ori_imgs"
        left.mkdir(parents=True)
        place.capture("exact").mkdir()
    with workplace(settings):
        assert not left.parent.exists() and place.capture("exact").is_dir()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"consent": "something else"}, r"with another consent \(me.mp4\)"),
        ({"licence": "CC0"}, "with another licence"),
    ],
)
def test_a_folder_keeps_to_what_was_agreed(settings, change, sentence):
    with workplace(settings):
        pass
    _refused(_other(settings, **change), SettingsError, sentence)


def test_a_folder_keeps_to_one_video(settings, tmp_path):
    with workplace(settings):
        pass
    (tmp_path / "other.mp4").write_bytes(b"another video")
    other = _other(settings, video=tmp_path / "other.mp4")
    _refused(other, SettingsError, "of another video")
    renamed = settings.video.rename(tmp_path / "renamed.mp4")
    with workplace(_other(settings, video=renamed)):
        pass


def test_an_avatar_that_was_written_right_before_a_kill_is_our_own(settings):
    with workplace(settings):
        settings.out.write_bytes(b"complete, and not yet noted")
    with workplace(settings) as place:
        assert not place.is_done(settings)


def test_another_maker_or_body_is_another_avatar(settings, tmp_path):
    body = tmp_path / "body.ico3d"  # a bundle may be a folder
    body.mkdir()
    (body / "manifest.json").write_text("{}")
    with workplace(settings) as place:
        settings.out.write_bytes(b"an avatar")
        told = _other(settings, body=str(body), made_by="Somebody")
        place.note_done(told)
        assert place.is_done(told)
        assert not place.is_done(_other(told, made_by="Somebody else"))
        (body / "manifest.json").write_text('{"name": "Another"}')
        assert not place.is_done(told)


def test_an_avatar_made_by_others_is_not_written_over(settings):
    settings.out.write_bytes(b"somebody else's")
    _refused(settings, SettingsError, "exists already")
    bundle = settings.out.with_suffix(".zip")
    _refused(_other(settings, out=bundle), SettingsError, r"must end in \.ico3d")
    nothing = _other(settings, video=settings.video / "no", out=bundle.with_name("b.ico3d"))
    _refused(nothing, SettingsError, "cannot be read")


def test_a_place_that_cannot_be_written(settings):
    inside = _other(settings, out=settings.video / "me.ico3d")
    _refused(inside, StorageError, "cannot be written")


def test_what_is_created_is_listed_with_its_command(settings, tmp_path):
    def state():
        (run,) = find_runs(tmp_path)
        return run.kind, run.state, run.reason, run.command.rpartition(" && ")[2]

    command = "ico3d create me.mp4 me.ico3d"
    with pytest.raises(CaptureError), carried_out(tuple(command.split())), workplace(settings):
        assert state() == ("create", "running", "", "")
        raise CaptureError("nobody is in the picture.")
    assert state() == ("create", "failed", "nobody is in the picture.", command)
    with pytest.raises(KeyboardInterrupt), workplace(settings):
        raise KeyboardInterrupt
    assert state() == ("create", "interrupted", "", command)
    with workplace(settings):
        pass
    assert state() == ("create", "finished", "", "")


@pytest.mark.parametrize("pipe", [True, False])
def test_a_folder_of_others_leads_to_no_other_file(settings, tmp_path, pipe):
    """Its lock was emptied before anything was compared, and its picture written over."""
    mine, work = tmp_path / "thesis.txt", tmp_path / "me.work"
    mine.write_text("years of work")
    work.mkdir()
    if pipe:
        os.mkfifo(work / "lock")
    else:
        (work / "lock").symlink_to(mine)
    _refused(settings, StorageError, "cannot be written")
    (work / "face.jpg").symlink_to(mine)
    Terminal(settings)(Preview(0.5, np.zeros((4, 8, 3), np.uint8)))
    (work / "strip.png").symlink_to(mine)
    _save_picture(np.zeros((4, 8, 3), np.uint8), work / "strip.png")
    assert mine.read_text() == "years of work"
    assert Image.open(work / "face.jpg").size == Image.open(work / "strip.png").size == (8, 4)
