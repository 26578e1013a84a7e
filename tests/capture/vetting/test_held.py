"""A decoder's pictures take a bounded part of the memory, whatever the stream says and when."""

import av
import pytest

from ico3d.capture.formats import open_capture
from ico3d.capture.multiview.clip import Clip
from ico3d.capture.vetting import held
from ico3d.capture.video import open_video
from ico3d.errors import CaptureError
from support.recordings import multiview_folders
from support.strangers.empty_pictures import write_held_pictures

pytestmark = pytest.mark.slow


def test_a_film_of_which_a_decoder_keeps_gigabytes_is_not_decoded(tmp_path):
    film = tmp_path / "a.mp4"
    write_held_pictures(film, 0, 20)
    assert film.stat().st_size < 200_000
    for read in (lambda: list(open_video(film, 48).frames(30.0)), lambda: Clip(film).count):
        with pytest.raises(CaptureError) as error:
            read()
        assert error.value.code == "costly"


def test_a_film_that_becomes_such_is_decoded_no_further(tmp_path):
    film = tmp_path / "a.mkv"
    write_held_pictures(film, 60, 3)
    video = open_video(film, 48)
    with pytest.raises(CaptureError) as error:
        list(video.frames(30.0))
    assert error.value.code == "costly"
    assert 1 < video.decoded <= 61
    with pytest.raises(CaptureError) as error:
        Clip(film).picture(63)
    assert error.value.code == "costly"


@pytest.mark.parametrize("codec, kind", [("hevc", "yuv420p10le"), ("prores", "yuv444p10le")])
def test_what_cameras_record_is_taken(codec, kind):
    context = av.CodecContext.create(codec, "r")
    context.width, context.height, context.pix_fmt = 8192, 4320, kind
    held.set_threads(context)
    held.check_held("film", context)
    assert 1 <= context.thread_count <= 4


def test_small_pictures_are_decoded_by_all_processors(monkeypatch):
    monkeypatch.setattr(held.os, "sched_getaffinity", lambda _: range(12))
    context = av.CodecContext.create("h264", "r")
    context.width, context.height, context.pix_fmt = 3840, 2160, "yuv420p"
    held.set_threads(context)
    assert context.thread_count == 13


def test_fewer_videos_are_open_where_they_take_more(tmp_path, monkeypatch):
    rig = multiview_folders.ring(3, (64, 48))
    for camera in rig:
        multiview_folders.write_video(tmp_path / "videos" / f"{camera.name}.mp4", 5)
    entries = [multiview_folders.entry(camera) for camera in rig]
    capture = open_capture(multiview_folders.write_cameras(tmp_path, entries, 5))
    monkeypatch.setattr(held, "MOST_BYTES", 64 * 48 * 3 // 2 * (held.HELD + held.MOST_THREADS))
    opened, close, most = set(), Clip.close, []

    def picture(clip, number, before=Clip.picture):
        opened.add(clip)
        most.append(len(opened))
        return before(clip, number)

    def closed(clip):
        opened.discard(clip)
        close(clip)

    monkeypatch.setattr(Clip, "picture", picture)
    monkeypatch.setattr(Clip, "close", closed)
    for frame in (0, 3):
        for camera in range(3):
            image = capture.image(camera, frame)
            assert image is not None and multiview_folders.number_of(image) == frame
    assert max(most) == 1
