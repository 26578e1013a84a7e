"""Damaged films, as `bench/fuzz` found them: read, or one sentence."""

from fractions import Fraction
from io import BytesIO

import av
import numpy as np
import pytest
from PIL import Image

from ico3d.capture import decoding
from ico3d.capture.multiview.clip import Clip
from ico3d.capture.video import LONGEST_PIECE, open_video, read_sound
from ico3d.errors import CaptureError
from support.recordings.films import write_film


def damaged(path, now, *marks):
    """A film in which some marks of four letters are another."""
    write_film(path)
    data = path.read_bytes()
    for mark in marks:
        assert mark in data
        data = data.replace(mark, now)
    path.write_bytes(data)
    return path


def test_pictures_of_an_unknown_kind_are_told(tmp_path):
    film = damaged(tmp_path / "a.mp4", b"what", b"avc1")
    with pytest.raises(CaptureError, match=r"cannot be decoded here\.$"):
        open_video(film, 48)
    with pytest.raises(CaptureError, match=r"can be decoded here\.$"):
        _ = Clip(film).count


def test_sound_of_an_unknown_kind_is_none(tmp_path):
    film = damaged(tmp_path / "a.mp4", b"what", b"mp4a", b"esds")
    assert read_sound(film) is None
    assert len(list(open_video(film, 48).frames(25.0))) == 10


def test_remarks_in_another_encoding_do_not_matter(tmp_path):
    film = damaged(tmp_path / "a.mp4", b"\xff\xfeav", b"Lavf")
    assert len(list(open_video(film, 48).frames(25.0))) == 10
    assert Clip(film).count == 10


def test_pictures_far_apart_are_not_repeated_for_ever(tmp_path):
    film = tmp_path / "a.webm"
    with av.open(str(film), "w") as container:
        stream = container.add_stream("libvpx", rate=25)
        stream.width = stream.height = 16
        for milliseconds in (0, 10**10):
            frame = av.VideoFrame.from_ndarray(np.zeros((16, 16, 3), np.uint8), "rgb24")
            frame.pts, frame.time_base = milliseconds, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(CaptureError, match=r"is longer than 7200 s\.$"):
        next(open_video(film, 16).frames(25.0))


def test_a_list_of_other_files_is_no_film(tmp_path):
    write_film(tmp_path / "other.mp4")
    film = tmp_path / "a.mp4"
    film.write_text("ffconcat version 1.0\nfile other.mp4\n")
    for read in (lambda: open_video(film, 48), lambda: Clip(film).count):
        with pytest.raises(CaptureError, match="as a video"):
            read()


def test_pictures_larger_than_cameras_make_are_not_decoded(tmp_path, monkeypatch):
    write_film(tmp_path / "a.mp4")
    monkeypatch.setattr(decoding, "MOST_PIXELS", 64 * 48 - 1)
    for read in (
        lambda: open_video(tmp_path / "a.mp4", 48),
        lambda: Clip(tmp_path / "a.mp4").count,
    ):
        with pytest.raises(CaptureError, match="64×48 pixels is larger than is taken"):
            read()


def test_pictures_with_a_side_that_ends_the_process_are_refused(tmp_path):
    film = tmp_path / "a.mkv"
    with av.open(str(film), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 40_000, 8, "gray"
        frame = av.VideoFrame(40_000, 8, "gray")
        container.mux([*stream.encode(frame), *stream.encode()])
    for read in (lambda: open_video(film, 48), lambda: Clip(film).count, lambda: read_sound(film)):
        with pytest.raises(CaptureError, match="40000×8 pixels is larger than is taken"):
            read()


def test_no_picture_larger_than_is_taken_is_decoded_while_a_film_is_opened(tmp_path, monkeypatch):
    film, png = tmp_path / "a.mov", BytesIO()
    Image.new("L", (200, 200)).save(png, "PNG")
    with av.open(str(film), "w") as container:
        stream = container.add_stream("png", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "gray"
        packet = av.Packet(png.getvalue())
        packet.stream, packet.pts, packet.dts, packet.time_base = stream, 0, 0, Fraction(1, 25)
        container.mux(packet)
    monkeypatch.setattr(decoding, "MOST_PIXELS", 100 * 100)
    # had it been decoded, its size would be known and told
    with pytest.raises(CaptureError, match="cannot be decoded"):
        open_video(film, 48)


def test_a_packet_of_thousands_of_sounds_does_not_fill_the_memory(tmp_path):
    """FFmpeg decodes all of them at once: a megabyte of silence would take three gigabytes."""
    film, silence = tmp_path / "a.mkv", np.zeros((2, 1024), np.float32)
    with av.open(str(film), "w") as container:
        stream = container.add_stream("aac", rate=48_000, layout="stereo")
        for start in range(0, 10 * 1024, 1024):
            frame = av.AudioFrame.from_ndarray(silence, "fltp", "stereo")
            frame.rate, frame.pts = 48_000, start
            for packet in stream.encode(frame):
                container.mux(packet)
        many = av.Packet(bytes(packet) * 30_000)
        many.stream, many.time_base = stream, Fraction(1, 48_000)
        many.pts = many.dts = 10 * 1024
        container.mux(many)
    sound = read_sound(film)
    assert sound is not None and len(sound.samples) < 16_000


@pytest.mark.parametrize("rate,pieces", [(48_000, 4608), (384_000, 32_768)])
def test_pieces_of_sound_that_are_longer_than_any_coder_makes_are_left_out(tmp_path, rate, pieces):
    """A packet of 128 KiB had 3,100 of 65,535 samples each, and took 6 GB."""
    film = tmp_path / "a.mka"
    with av.open(str(film), "w") as container:
        stream = container.add_stream("flac", rate=rate, layout="mono")
        stream.codec_context.format = "s16"
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 4 * pieces), np.int16), "s16", "mono")
        frame.rate, frame.pts = rate, 0
        for packet in [*stream.encode(frame), *stream.encode()]:
            container.mux(packet)
    assert stream.codec_context.frame_size == pieces
    sound = read_sound(film)
    assert (sound is not None) == (pieces <= LONGEST_PIECE)
