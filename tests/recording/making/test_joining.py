"""Parts become one video: pictures evenly by time, sound as long as they are."""

import numpy as np
import pytest

from ico3d.capture.video import open_video, read_sound
from ico3d.errors import CaptureError
from ico3d.recording.making import joining
from ico3d.recording.making.joining import join
from support.needs import needs
from support.studio_page.parts import part_file

pytestmark = needs("av")


def test_parts_follow_one_another_with_their_sound(tmp_path):
    files = [
        part_file(tmp_path / "a.mp4", 30, level=60),
        part_file(tmp_path / "b.mp4", 20, level=200, sound=False),
        part_file(tmp_path / "c.mp4", 25, level=60, size=(32, 32)),
    ]
    join(files, tmp_path / "whole.mp4")
    video = open_video(tmp_path / "whole.mp4", 512)
    light = [float(picture.mean()) for picture in video.frames(25)]
    assert (video.width, video.height, len(light)) == (64, 64, 75)
    assert np.abs(np.diff(np.array(light) > 130)).nonzero()[0].tolist() == [29, 49]
    sound = read_sound(tmp_path / "whole.mp4")
    assert sound is not None and len(sound.samples) == pytest.approx(75 * 640, abs=1100)
    loud = [
        float(np.abs(part).mean()) for part in np.split(sound.samples[: 75 * 640], [19200, 32000])
    ]
    assert loud[0] > 0.1 and loud[2] > 0.1 and loud[1] < 0.01


def test_a_part_of_another_shape_is_named(tmp_path):
    files = [part_file(tmp_path / "a.mp4", 2), part_file(tmp_path / "b.mp4", 2, size=(64, 48))]
    with pytest.raises(CaptureError, match=r"b\.mp4 has another shape than a\.mp4: record it"):
        join(files, tmp_path / "whole.mp4")
    assert not (tmp_path / "whole.mp4").exists()


def test_all_parts_together_are_no_longer_than_one_recording_may_be(tmp_path, monkeypatch):
    monkeypatch.setattr(joining, "RECORDING", 2.0)
    monkeypatch.setattr(joining, "read_sound", lambda _: pytest.fail("before their sound is read"))
    files = [part_file(tmp_path / f"{name}.mp4", 30) for name in "ab"]
    with pytest.raises(CaptureError, match="longer than 2 s"):
        join(files, tmp_path / "whole.mp4")
