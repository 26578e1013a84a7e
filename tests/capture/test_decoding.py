"""Pictures of anybody: of two kinds, of bounded size, by one function."""

import io
import json
import os
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import EpsImagePlugin, Image, ImageFile

import ico3d
from ico3d.capture.decoding import MOST_SIDE, decoded, has_opacity, open_picture, size_of
from ico3d.capture.formats import open_capture
from ico3d.capture.vetting import chunks
from ico3d.creating.looking.examine import refuse_photograph
from ico3d.errors import CaptureError
from ico3d.measure.comparison import pictures_of

EPS = (
    b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 64 64\n%%EndComments\n"
    b"(/etc/passwd) (r) file pop\nshowpage\n%%EOF\n"
)


@pytest.fixture(autouse=True)
def no_program(monkeypatch):
    """Fails where Pillow would start Ghostscript."""
    monkeypatch.setattr(EpsImagePlugin, "Ghostscript", lambda *_: pytest.fail("gs was started"))


def png(width, height):
    """The beginning of a PNG picture that claims a size."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    body = b"IDAT" + zlib.compress(bytes(99))
    chunks = (
        struct.pack(">I", len(c) - 4) + c + struct.pack(">I", zlib.crc32(c)) for c in (head, body)
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def test_no_program_is_started_for_a_picture(tmp_path):
    file = tmp_path / "000000.jpg"
    file.write_bytes(EPS)
    for source in (file, EPS):
        for read in (decoded, size_of, has_opacity):
            with pytest.raises(CaptureError, match=r"^picture is damaged and cannot be decoded\.$"):
                read(source, "picture")
    with pytest.raises(CaptureError, match="cannot be read as a picture"):
        next(pictures_of(tmp_path, 25.0))


def test_no_program_is_started_for_a_picture_of_a_portrait(tmp_path):
    (tmp_path / "ori_imgs").mkdir()
    (tmp_path / "ori_imgs" / "0.jpg").write_bytes(EPS)
    frame = {"img_id": 0, "aud_id": 0, "transform_matrix": np.eye(4).tolist()}
    for name, frames in (("train", [frame]), ("val", [])):
        about = {"focal_len": 60, "cx": 32, "cy": 32, "frames": frames}
        (tmp_path / f"transforms_{name}.json").write_text(json.dumps(about))
    with pytest.raises(CaptureError, match="cannot be read"):
        open_capture(tmp_path)


@pytest.mark.parametrize("kind", ["TIFF", "BMP", "GIF", "WEBP", "ICO"])
def test_kinds_that_no_layout_has_are_refused(tmp_path, kind):
    Image.new("RGB", (32, 32)).save(tmp_path / "a.png", kind)
    with pytest.raises(CaptureError, match="cannot be decoded"):
        decoded(tmp_path / "a.png", "picture")


@pytest.mark.parametrize(
    "size", [(6000, 5900), (13_300, 13_400), (60_000, 60_000), (MOST_SIDE + 1, 1)]
)
@pytest.mark.filterwarnings("ignore::PIL.Image.DecompressionBombWarning")
def test_pictures_larger_than_cameras_make_are_refused_by_their_header(monkeypatch, size):
    monkeypatch.setattr(ImageFile.ImageFile, "load", lambda _: pytest.fail("decoded"))
    for read in (decoded, size_of):
        with pytest.raises(CaptureError, match="larger than is taken"):
            read(png(*size), "picture")
    assert open_picture(png(MOST_SIDE, 1), "picture").size == (MOST_SIDE, 1)


def test_pictures_are_opened_in_kinds_that_are_named():
    """Pillow tries all that it knows otherwise."""
    for file in Path(ico3d.__file__).parent.rglob("*.py"):
        calls = re.findall(r"\bImage\.open\((.*)", file.read_text("utf-8"))
        assert all("formats=" in call for call in calls), file


def passes(times, **options):
    """A JPEG picture, and the same one whose last pass comes again."""
    written = io.BytesIO()
    noise = np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8)
    Image.fromarray(noise).save(written, "JPEG", **options)
    whole = written.getvalue()
    last = whole[whole.rfind(b"\xff\xda") : -2]
    return whole, whole[:-2] + last * times + whole[-2:]


def test_a_picture_of_thousands_of_passes_is_not_opened(tmp_path):
    whole, many = passes(1000, progressive=True)
    (tmp_path / "many.jpg").write_bytes(many)
    hidden = many[:2] + b"\xff\xe1\0\x06\xff\xd9\xff\xd9" + many[2:]  # an end in a remark
    assert decoded(whole, "picture").shape == (48, 64, 3)
    for source in (many, tmp_path / "many.jpg", hidden):
        for read in (decoded, size_of, has_opacity, open_picture):
            with pytest.raises(CaptureError, match="more passes than cameras make"):
                read(source, "picture")


def test_passes_that_are_not_decoded_do_not_count():
    whole, many = passes(1000, quality=90)
    assert size_of(many, "picture") == (64, 48)  # all colours are in the first pass
    film = whole + b"\xff\xda\0\x08" * 1000  # such as phones put behind a picture
    assert decoded(film, "picture").shape == (48, 64, 3)
    progressive, _ = passes(0, progressive=True)
    assert decoded(progressive + b"\xff\xda\0\x08" * 1000, "picture").shape == (48, 64, 3)


def test_segments_have_an_end():
    whole, _ = passes(0, progressive=True)
    many = whole[:2] + b"\xff\xe1\0\x02" * 20_000 + whole[2:]
    with pytest.raises(CaptureError, match="more beside its pixels than cameras make"):
        size_of(many, "picture")


def test_nothing_waits_for_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "a.jpg")
    with pytest.raises(CaptureError, match="cannot be decoded"):
        size_of(tmp_path / "a.jpg", "picture")


@pytest.mark.parametrize("where", ["before", "behind"])
@pytest.mark.parametrize("kept", ["bytes", "a file"])
def test_what_a_picture_has_beside_its_pixels_is_bounded(tmp_path, monkeypatch, where, kept):
    """Pillow reads each chunk whole: a hole of gigabytes became as much memory."""
    monkeypatch.setattr(chunks, "BESIDE", 1000)
    content = io.BytesIO()
    Image.new("RGB", (40, 30), "teal").save(content, "PNG")
    picture = content.getvalue()
    at = 33 if where == "before" else len(picture) - 12

    def padded(size):
        chunk = b"prVt" + bytes(size)
        chunk = struct.pack(">I", size) + chunk + struct.pack(">I", zlib.crc32(chunk))
        data = picture[:at] + chunk + picture[at:]
        (tmp_path / "a.png").write_bytes(data)
        return data if kept == "bytes" else tmp_path / "a.png"

    assert decoded(padded(900), "it").shape == (30, 40, 3)
    with pytest.raises(CaptureError, match="more beside its pixels than cameras make"):
        decoded(padded(1100), "it")


def test_chunks_have_an_end(monkeypatch):
    monkeypatch.setattr(chunks, "MOST_CHUNKS", 50)
    empty = struct.pack(">I", 0) + b"IDAT" + struct.pack(">I", zlib.crc32(b"IDAT"))
    assert chunks.has_large_chunks(io.BytesIO(chunks.SIGNATURE + empty * 60))
    assert not chunks.has_large_chunks(io.BytesIO(chunks.SIGNATURE + empty * 40))


def test_a_large_file_of_another_kind_is_not_opened(tmp_path, monkeypatch):
    """Pillow read a WebP whole, twice: a hole of gigabytes became as much memory."""
    monkeypatch.setattr(Image, "open", lambda *_, **__: pytest.fail("opened"))
    hole = tmp_path / "0.webp"
    hole.write_bytes(b"RIFF\0\0\0\0WEBPVP8 ")
    with hole.open("r+b") as file:
        file.truncate(chunks.LARGEST_OTHER + 1)
    with pytest.raises(CaptureError, match="file is larger than is taken"):
        next(pictures_of(tmp_path, 25.0))
    with pytest.raises(CaptureError, match="is a photograph"):
        refuse_photograph(hole)


def with_segments(count, content):
    whole, _ = passes(0, quality=90)
    segment = b"\xff\xe1" + struct.pack(">H", len(content) + 2) + content
    return whole[:2] + segment * count + whole[2:]


@pytest.mark.parametrize("count, content", [(300, b"http" + bytes(65_000)), (65, b"Exif\0\0II")])
def test_a_jpeg_has_only_so_much_beside_its_pixels(monkeypatch, count, content):
    assert size_of(with_segments(60, content), "picture") == (64, 48)
    monkeypatch.setattr(Image, "open", lambda *_, **__: pytest.fail("opened"))
    with pytest.raises(CaptureError, match="more beside its pixels"):
        size_of(with_segments(count, content), "picture")
