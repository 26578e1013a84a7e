"""Films whose tables promise more than a film of their size can hold."""

import re
import struct

import av
import pytest

from ico3d.capture.multiview.clip import Clip
from ico3d.capture.vetting import promises
from ico3d.capture.vetting.promises import check_promises
from ico3d.capture.video import open_video, read_sound
from ico3d.errors import CaptureError
from support.recordings.films import write_film

MANY = 60_000_000
BEGIN = struct.pack(">I4s4sI4s", 20, b"ftyp", b"isom", 512, b"mp42")


def box(name, *content):
    """A box of an MP4 file."""
    data = b"".join(content)
    return struct.pack(">I4s", 8 + len(data), name) + data


def table(name, *numbers, head=0):
    """A box of a version, flags and numbers of 32 bits."""
    return box(name, struct.pack(f">{1 + len(numbers)}I", head, *numbers))


def track(*tables, kind=b"vide"):
    """A track with a handler and tables."""
    handler = box(b"hdlr", bytes(8), kind, bytes(13))
    return box(b"trak", box(b"mdia", handler, box(b"minf", box(b"stbl", *tables))))


def moof(count):
    """A piece of a film."""
    return box(b"moof", box(b"traf", table(b"trun", count)))


def index(length):
    """An index of one piece, `length` bytes behind it."""
    return table(b"sidx", 1, 25, 0, length, 1, 40, 1, 0)


LONG = table(b"stsz", 1, MANY)
TICKS = table(b"stts", 1, 1000, 1)
PROMISING = {
    "sizes": box(b"moov", track(LONG)),
    "small sizes": box(b"moov", track(table(b"stz2", 4, MANY))),
    "times": box(b"moov", track(table(b"stts", 1, MANY, 1))),
    "chunks": box(
        b"moov",
        track(TICKS, table(b"stsc", 1, 1, MANY, 1), table(b"stco", 4, *[0] * 4), kind=b"soun"),
    ),
    "chunks that swap": box(
        b"moov", track(TICKS, table(b"stsc", 2, 4, MANY, 1, 1, 9, 1), table(b"stco", 4, *[0] * 4))
    ),
    "more entries than bytes": box(b"moov", track(table(b"stts", MANY, 1, 1))),
    "pieces": moof(MANY),
    "encrypted pieces": box(b"moof", box(b"traf", table(b"senc", MANY))),
    "lengths of encrypted pieces": box(
        b"moof", box(b"traf", box(b"saiz", bytes(5), struct.pack(">I", MANY)))
    ),
    "still pictures": box(b"meta", box(b"iloc", b"\2", bytes(5), struct.pack(">I", MANY))),
    "names of still pictures": box(b"meta", table(b"iinf", MANY, head=1 << 24)),
    "edits": box(b"moov", box(b"trak", box(b"edts", table(b"elst", promises.MOST_EDITS + 1)))),
    "compressed": box(b"moov", box(b"cmov", box(b"dcom", b"zlib"))),
    "tracks": box(b"moov", *[track()] * (promises.MOST_TRACKS + 1)),
    "in odd places": box(b"moov", track(box(b"stsd", bytes(11), LONG))),
    "cut off at the end of a box": box(b"moov", track(table(b"stsz")))
    + struct.pack(">II", MANY, MANY),
    "the last box of all": LONG,
    "a box without an end": struct.pack(">I4s", 0, b"moov") + track(LONG),
    "a box of 64 bits": struct.pack(">I4sQ", 1, b"moov", 16 + len(track(LONG))) + track(LONG),
    "free space": box(b"free", table(b"mvhd", 0), track(LONG)),
    "behind pictures": box(b"mdat", bytes(99)) + box(b"moov", track(LONG)),
    "among pictures, by an index": index(8 + 33) + box(b"mdat", bytes(33), moof(MANY)),
    "among pictures, at their end": index(8 + 33)
    + box(b"mdat", bytes(33), table(b"skip", 5), moof(MANY)),
}


@pytest.mark.parametrize("name", PROMISING)
def test_a_film_that_promises_more_than_it_holds_is_not_opened(tmp_path, monkeypatch, name):
    monkeypatch.setattr(av, "open", lambda *_, **__: pytest.fail("it was opened"))
    film = tmp_path / "a.mp4"
    film.write_bytes(BEGIN + PROMISING[name])
    for read in (lambda: open_video(film, 48), lambda: read_sound(film), lambda: Clip(film).count):
        with pytest.raises(CaptureError, match="promise more than the file can hold"):
            read()


def test_each_edit_counts_as_a_copy_of_the_samples(tmp_path, monkeypatch):
    monkeypatch.setattr(promises, "MOST_SAMPLES", 1000)
    film = tmp_path / "a.mp4"
    for edits, samples, refused in ((1, 1000, False), (2, 500, False), (2, 501, True)):
        edit = box(b"edts", table(b"elst", edits, *(samples, 0, 1 << 16) * edits))
        tables = (table(b"stts", 1, samples, 512), table(b"stsz", 1, samples))
        content = track(*tables)
        content = box(b"trak", edit, content[8:])
        film.write_bytes(BEGIN + box(b"mdat", bytes(9_999)) + box(b"moov", content))
        if refused:
            with pytest.raises(CaptureError, match="promise more"):
                check_promises(film)
        else:
            assert check_promises(film)


def test_samples_are_bounded_in_large_files_too(tmp_path, monkeypatch):
    monkeypatch.setattr(promises, "MOST_SAMPLES", 1005)  # five blocks of sound among them
    film = tmp_path / "a.mp4"
    for kind, times, refused in (
        (b"soun", TICKS, False),  # blocks of uncompressed sound
        (b"soun", table(b"stts", 1, 1001, 1024), True),
        (b"vide", table(b"stts", 1, 1001, 1), True),
        (b"vide", TICKS, False),
    ):
        tables = (times, table(b"stsz", 2, 1001 if refused else 1000))
        sound = track(TICKS, table(b"stsz", 2, 5000), kind=b"soun")
        film.write_bytes(
            BEGIN + box(b"mdat", bytes(99_999)) + box(b"moov", sound, track(*tables, kind=kind))
        )
        if refused:
            with pytest.raises(CaptureError, match="promise more"):
                check_promises(film)
        else:
            assert check_promises(film)


def test_pieces_of_uncompressed_sound_are_bounded_too(tmp_path, monkeypatch):
    monkeypatch.setattr(promises, "MOST_SAMPLES", 1000)
    film = tmp_path / "a.mov"
    for chunks, samples, refused in ((999, 1000, False), (1000, 1000, True), (9, 10**6, False)):
        times, sizes = table(b"stts", 1, samples, 1), table(b"stsz", 1, samples)
        places = table(b"stco", chunks, *[0] * chunks)
        sound = track(times, table(b"stsc", 1, 1, 1, 1), sizes, places, kind=b"soun")
        film.write_bytes(BEGIN + box(b"mdat", bytes(10**6)) + box(b"moov", sound))
        if refused:
            with pytest.raises(CaptureError, match="promise more"):
                check_promises(film)
        else:
            assert check_promises(film)


@pytest.mark.parametrize("most", ["MOST_BOXES", "MOST_TABLES", "MOST_BYTES"])
def test_looking_has_an_end(tmp_path, monkeypatch, most):
    film = tmp_path / "a.mp4"
    film.write_bytes(BEGIN + moof(1) * 3 + box(b"moov", track(table(b"stts", 1, 9, 1)) * 3))
    assert check_promises(film)
    monkeypatch.setattr(promises, most, 3)
    with pytest.raises(CaptureError, match="promise more"):
        check_promises(film)


@pytest.mark.parametrize(
    ("suffix", "options"),
    [
        ("mp4", {"movflags": "faststart"}),
        ("mp4", {"movflags": "frag_keyframe+empty_moov"}),
        ("mp4", {"movflags": "frag_every_frame+empty_moov+default_base_moof"}),
        ("mp4", {"movflags": "dash+frag_keyframe"}),
        ("mov", {}),
        ("3gp", {}),
    ],
)
def test_films_in_all_forms_of_boxes_are_opened(tmp_path, suffix, options):
    write_film(tmp_path / "whole.mp4")
    film = tmp_path / f"a.{suffix}"
    with av.open(tmp_path / "whole.mp4") as given, av.open(film, "w", options=options) as made:
        streams = [made.add_stream_from_template(stream) for stream in given.streams]
        for packet in given.demux():
            if packet.dts is not None:
                packet.stream = streams[packet.stream.index]
                made.mux(packet)
    assert check_promises(film)
    assert next(open_video(film, 48).frames(25.0)).shape == (48, 64, 3)


def test_uncompressed_sound_is_heard(tmp_path):
    film = tmp_path / "a.mov"
    with av.open(film, "w") as made:
        stream = made.add_stream("pcm_u8", rate=48_000, layout="mono")
        for start in range(0, 96_000, 4800):
            frame = av.AudioFrame("u8", "mono", 4800)
            frame.planes[0].update(bytes(range(100)) * 48)
            frame.rate, frame.pts = 48_000, start
            made.mux(stream.encode(frame))
        made.mux(stream.encode())
    sound = read_sound(film)
    assert sound is not None
    assert len(sound.samples) == pytest.approx(2 * sound.rate, rel=0.01)


def test_other_files_are_no_films_of_boxes(tmp_path):
    write_film(tmp_path / "a.mkv")
    assert not check_promises(tmp_path / "a.mkv")
    assert len(list(open_video(tmp_path / "a.mkv", 48).frames(25.0))) == 10
    hidden = tmp_path / "b.mp4"  # FFmpeg would take it, without a look at its tables
    write_film(hidden)
    hidden.write_bytes(box(b"abcd", bytes(8)) + hidden.read_bytes())
    with pytest.raises(CaptureError, match=re.escape(str(hidden))):
        open_video(hidden, 48)


def test_nothing_waits_for_a_device(tmp_path):
    (tmp_path / "a.mp4").symlink_to("/dev/zero")
    with pytest.raises(OSError, match="no regular file"):
        check_promises(tmp_path / "a.mp4")
