"""Videos: any picture in any order is the right one."""

import os
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from ico3d.capture.checking.check import examine
from ico3d.capture.formats import open_capture, opened_apart
from ico3d.capture.multiview.clip import MOST_OPEN, Clip
from ico3d.errors import CaptureError
from support.recordings import multiview_folders

KINDS = {
    "key every 12, reordered": ("mp4", "libx264", {"bf": "3", "crf": "30"}, 12),
    "one key, Matroska": ("mkv", "libx264", {"bf": "3"}, 250),
    "open groups": ("mp4", "libx264", {"x264-params": "open-gop=1:bframes=4"}, 10),
    "VP9": ("webm", "libvpx-vp9", {"deadline": "realtime", "cpu-used": "8"}, 15),
    "MPEG-4, AVI": ("avi", "mpeg4", {}, 10),
}


@pytest.mark.parametrize("kind", KINDS)
def test_any_order_gives_the_same_pictures(tmp_path, kind):
    suffix, codec, options, keys = KINDS[kind]
    path = multiview_folders.write_video(tmp_path / f"clip.{suffix}", 60, codec, options, keys)
    clip = Clip(path)
    assert clip.count == 60 and clip.picture(60) is None
    in_order = [clip.picture(number) for number in range(60)]
    assert [multiview_folders.number_of(image) for image in in_order] == list(range(60))
    for number in np.random.default_rng(0).integers(0, 60, 40).tolist():
        np.testing.assert_array_equal(clip.picture(number), in_order[number])


def recording(folder, cameras=6, frames=20):
    rig = multiview_folders.ring(cameras, (64, 48))
    for camera in rig:
        multiview_folders.write_video(folder / "videos" / f"{camera.name}.mp4", frames)
    return multiview_folders.write_cameras(
        folder, [multiview_folders.entry(camera) for camera in rig], frames
    )


def test_few_videos_are_open_at_a_time(tmp_path):
    capture = open_capture(recording(tmp_path))
    before = len(os.listdir("/proc/self/fd"))
    for frame in (0, 7, 3):
        for camera in range(6):
            assert multiview_folders.number_of(capture.image(camera, frame)) == frame
    assert len(os.listdir("/proc/self/fd")) - before <= MOST_OPEN


def test_threads_decode_for_themselves(tmp_path):
    """Each in its own order, at the same time."""
    capture = open_capture(recording(tmp_path, cameras=2))
    assert multiview_folders.number_of(capture.image(0, 4)) == 4
    orders = ([5, 6, 2, 7], [19, 0, 11, 12], [4, 3, 2, 1])

    def numbers(order):
        own = opened_apart(capture)
        return [multiview_folders.number_of(own.image(0, frame)) for frame in order]

    with ThreadPoolExecutor(3) as pool:
        assert tuple(pool.map(numbers, orders)) == orders


def test_forked_processes_and_pickled_copies_read_for_themselves(tmp_path):
    capture = open_capture(recording(tmp_path, cameras=2))
    assert multiview_folders.number_of(capture.image(0, 4)) == 4
    children = []
    for wanted in ((5, 6, 2), (19, 0, 11)):
        child = os.fork()
        if child == 0:
            code = 1
            try:
                code = int(
                    any(
                        multiview_folders.number_of(capture.image(0, frame)) != frame
                        for frame in wanted
                    )
                )
            finally:
                os._exit(code)
        children.append(child)
    assert [multiview_folders.number_of(capture.image(0, frame)) for frame in (5, 6)] == [5, 6]
    assert [os.waitpid(child, 0)[1] for child in children] == [0, 0]
    copy = pickle.loads(pickle.dumps(capture))
    assert multiview_folders.number_of(copy.image(1, 13)) == 13


def test_short_videos_lack_views(tmp_path):
    folder = recording(tmp_path, cameras=3)
    multiview_folders.write_video(folder / "videos/cam01.mp4", 18)
    capture = open_capture(folder)
    assert capture.image(1, 18) is None and capture.image(1, 17) is not None
    (finding,) = (f for f in examine(capture) if f.what == "views")
    assert finding.level == "warn"
    assert finding.text == "missing: camera cam01, frame 18 (and 1 more)"


def test_damaged_videos_are_one_sentence(tmp_path):
    path = multiview_folders.write_video(tmp_path / "clip.mp4", 30)
    whole = path.read_bytes()
    for cut in (0, 10, len(whole) // 2):
        path.write_bytes(whole[:cut])
        with pytest.raises(CaptureError, match=r"clip\.mp4") as error:
            [Clip(path).picture(number) for number in range(30)]
        assert "\n" not in str(error.value)


def test_damage_within_a_video_costs_the_pictures_around_it(tmp_path):
    """What is made of a lost picture is not given as if it were right."""
    path = multiview_folders.write_video(tmp_path / "clip.mp4", 48, options={"crf": "5"}, keys=12)
    data = bytearray(path.read_bytes())
    start, end = data.index(b"mdat") + 4, data.index(b"moov")
    place = start + (end - start) // 2
    data[place : place + 200] = np.random.default_rng(0).bytes(200)
    path.write_bytes(data)
    clip, found = Clip(path), []
    for number in range(48):
        try:
            found.append(multiview_folders.number_of(clip.picture(number)) == number)
        except CaptureError as error:
            assert f"frame {number} is damaged" in str(error)
    assert all(found) and 30 <= len(found) < 48
