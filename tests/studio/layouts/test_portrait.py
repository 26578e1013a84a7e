"""Captures written in the layout of talking portraits."""

import numpy as np
import pytest

from ico3d.capture.formats import open_capture
from ico3d.errors import CaptureError
from ico3d.studio.layouts.portrait import write_portrait
from support.heads.tiny_talker import HEIGHT, TinyTalker


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A talker and what the reader makes of its folder."""
    folder = tmp_path_factory.mktemp("portrait")
    talker = TinyTalker(folder / "talker")
    return talker, open_capture(write_portrait(talker, folder / "written"))


def test_the_reader_finds_what_was_written(written):
    talker, portrait = written
    assert portrait.kind == "portrait" and portrait.num_frames == talker.num_frames
    assert portrait.split.test == talker.split.test and portrait.fps == talker.fps
    assert np.abs(portrait.image(0, 3) - talker.image(0, 3)).mean() < 0.02  # JPEG
    assert np.abs(portrait.background(0) - 0.5).max() < 0.01
    np.testing.assert_allclose(portrait.landmarks(0, 3), talker.landmarks(0, 3), atol=1e-3)
    sound, heard = talker.audio(), portrait.audio()
    assert heard.rate == sound.rate and np.abs(heard.samples - sound.samples).max() < 1e-4


def test_poses_and_lens_show_the_same_points_at_the_same_pixels(written):
    talker, portrait = written
    for frame in (0, 7):
        seen = portrait.cameras[0].moved(portrait.world_from_head(frame))
        pixels, _ = seen.project(talker.landmarks_3d(frame))
        np.testing.assert_allclose(pixels, talker.landmarks(0, frame), atol=1e-9)


def test_head_torso_and_background_part_the_picture(written):
    _, portrait = written
    head, person, torso = portrait.head_mask(0, 5), portrait.mask(0, 5), portrait.torso(0, 5)
    assert head[:-8].sum() > 300 and head[-8:].sum() == 0
    assert (torso[-8:, :, 3] == 1).all() and torso[: HEIGHT // 2, :, 3].max() == 0
    solid = person > 0.5
    assert ((head > 0) | (torso[..., 3] > 0.4))[solid].all()
    np.testing.assert_allclose(torso[-4, 10, :3], (0.1, 0.6, 0.2), atol=0.01)


def test_what_is_missing_is_named(tmp_path):
    talker = TinyTalker(tmp_path)
    talker.background = lambda camera: None
    with pytest.raises(CaptureError, match="no clean plate of camera 0"):
        write_portrait(talker, tmp_path / "out")
