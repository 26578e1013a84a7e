from pathlib import Path

import numpy as np
import pytest

from ico3d.capture.video import open_video, read_sound
from ico3d.errors import CaptureError

pytestmark = pytest.mark.slow

av = pytest.importorskip("av")


def write_video(path: Path, levels, fps=25, size=(96, 64), tone=None, codec="libx264") -> Path:
    """A video whose frame k has the grey `levels[k]`; `tone` is (rate, samples)."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=fps, options={"crf": "1", "g": "4"})
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        sound = None if tone is None else container.add_stream("aac", rate=tone[0], layout="mono")
        for level in levels:
            picture = np.full((size[1], size[0], 3), level, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode())
        if sound is not None:
            frame = av.AudioFrame.from_ndarray(tone[1][None].astype(np.float32), "fltp", "mono")
            frame.sample_rate, frame.pts = tone[0], 0  # so that encoder delay is written down
            container.mux(sound.encode(frame))
            container.mux(sound.encode())
    return path


def _levels(video, fps=25.0):
    return [float(image.mean()) for image in video.frames(fps)]


def test_every_frame_once_at_its_own_rate(tmp_path):
    levels = list(range(20, 220, 10))
    video = open_video(write_video(tmp_path / "v.mp4", levels), 512)
    assert np.abs(np.array(_levels(video)) - levels).max() < 4
    assert (video.decoded, video.announced, video.damaged) == (20, 20, 0)


@pytest.mark.parametrize(("fps", "count"), [(30, 60), (50, 100), (15, 30)])
def test_other_rates_are_resampled_by_time(tmp_path, fps, count):
    levels = np.linspace(20, 220, count).round().astype(int)
    video = open_video(write_video(tmp_path / "v.mp4", levels, fps), 512)
    given = np.array(_levels(video))
    assert len(given) == pytest.approx(50, abs=1)
    times = np.arange(len(given)) / 25
    nearest = levels[np.minimum(np.floor(times * fps + 0.5 - 1e-9), count - 1).astype(int)]
    step = np.diff(levels).max()
    assert np.abs(given - nearest).max() <= step + 4


def test_pictures_that_stand_in_for_others_are_told(tmp_path):
    video = open_video(write_video(tmp_path / "v.mp4", list(range(20, 200, 6)), 15), 512)
    told = list(video.sampled(25.0))
    own = [picture.mean() for picture, own in told if own]
    assert len(told) == pytest.approx(50, abs=1)
    assert np.abs(np.array(own) - range(20, 200, 6)).max() < 4  # each of the 30 pictures once
    whole = open_video(write_video(tmp_path / "w.mp4", [100] * 20, 25), 512)
    assert all(own for _, own in whole.sampled(25.0))
    fast = open_video(write_video(tmp_path / "f.mp4", [100] * 40, 50), 512)
    assert all(own for _, own in fast.sampled(25.0))


def test_large_videos_are_scaled_down_and_small_ones_are_not(tmp_path):
    path = write_video(tmp_path / "v.mp4", [100] * 3)
    assert next(open_video(path, 32).frames(25)).shape == (32, 48, 3)
    assert open_video(path, 32).scale == 0.5
    assert next(open_video(path, 512).frames(25)).shape == (64, 96, 3)


def test_sound_is_16_khz_and_starts_with_the_pictures(tmp_path):
    samples = np.zeros(44_100)
    samples[22_050:23_050] = np.sin(np.arange(1000) / 4)
    sound = read_sound(write_video(tmp_path / "v.mp4", [100] * 25, tone=(44_100, samples)))
    assert sound.rate == 16_000 and sound.samples.dtype == np.float32
    assert np.flatnonzero(np.abs(sound.samples) > 0.3)[0] / 16_000 == pytest.approx(0.5, abs=0.003)


def test_video_without_sound(tmp_path):
    assert read_sound(write_video(tmp_path / "v.mp4", [100] * 5)) is None


def test_truncated_video_gives_what_is_there(tmp_path):
    path = write_video(tmp_path / "v.mkv", np.random.default_rng(0).integers(0, 255, 100))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    levels = _levels(open_video(path, 512))
    assert 20 < len(levels) < 90


def test_file_that_cannot_be_decoded(tmp_path):
    path = write_video(tmp_path / "v.mp4", [100] * 30)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 3])  # an MP4's index is at its end
    with pytest.raises(CaptureError, match=r"v\.mp4: the file cannot be decoded"):
        open_video(path, 512)


def test_no_video_at_all(tmp_path):
    (tmp_path / "v.mp4").write_text("hello")
    with pytest.raises(CaptureError, match="cannot be decoded"):
        open_video(tmp_path / "v.mp4", 512)
    with pytest.raises(CaptureError, match="there is no video"):
        open_video(tmp_path / "none.mp4", 512)
