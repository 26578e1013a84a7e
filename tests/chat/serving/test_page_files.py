"""How the page's files travel: small where the browser takes it, kept where that is safe."""

import asyncio
import gzip
import os

import httpx
import pytest
from fastapi import FastAPI
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ico3d.chat.serving import server
from ico3d.chat.serving.page_files import PIECE, PageFiles

SCRIPT, SHEET, PICTURE = "assets/index-C0ffee00.js", "assets/index-C0ffee00.css", "assets/x-1.png"
TEXTS = {
    "index.html": b"<!doctype html><title>A page</title>" * 9,
    SCRIPT: b"export const answer = 42;\n" * 99,
}
ONLY_PLAIN = {SHEET: b"p{}", PICTURE: b"\x89PNG"}
READERS = {None: bytes, "gzip": gzip.decompress, "br": lambda data: data[::-1]}
FOR_EVER = "public, max-age=31536000, immutable"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What Vite leaves, with stand-ins for brotli, which Python cannot read."""
    folder = tmp_path_factory.mktemp("static")
    (folder / "assets").mkdir()
    for name, data in (TEXTS | ONLY_PLAIN).items():
        (folder / name).write_bytes(data)
    for name, data in TEXTS.items():
        (folder / f"{name}.gz").write_bytes(gzip.compress(data))
        (folder / f"{name}.br").write_bytes(data[::-1])
    return folder


@pytest.fixture
def page(folder, monkeypatch):
    return client(folder, monkeypatch)


def client(folder, monkeypatch):
    monkeypatch.setattr(server, "STATIC", folder)
    app = FastAPI()
    server.add_page(app)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://page")


async def raw(page, name, **headers):
    """Status, headers and the bytes on the wire."""
    asked = {
        "Accept-Encoding": "",
        **{key.replace("_", "-"): text for key, text in headers.items()},
    }
    async with page.stream("GET", f"/{name}", headers=asked) as answer:
        return answer, b"".join([part async for part in answer.aiter_raw()])


@pytest.mark.parametrize(
    ("accepted", "coding"),
    [
        ("gzip, deflate, br, zstd", "br"),
        ("gzip, deflate", "gzip"),
        ("GZIP", "gzip"),
        ("br;q=0.2, gzip;q=0.8", "gzip"),
        ("br; q=0.0, gzip ; q=1", "gzip"),
        ("br;q=0, gzip;q=0.000", None),
        ("*", "br"),
        ("br;q=0, *;q=0.5", "gzip"),
        ("*;q=0", None),
        ("identity", None),
        ("deflate, zstd", None),
        ("br;q=2, gzip;quality=1, x", None),
        ("brr, xgzip", None),
        ("", None),
    ],
)
@pytest.mark.parametrize("name", TEXTS)
async def test_the_browser_says_in_which_form_a_text_comes(page, name, accepted, coding):
    answer, body = await raw(page, name, Accept_Encoding=accepted)
    assert answer.status_code == 200
    assert answer.headers.get("content-encoding") == coding
    assert READERS[coding](body) == TEXTS[name]
    assert answer.headers["vary"] == "Accept-Encoding"
    assert answer.headers["content-length"] == str(len(body))
    types = {"index.html": "text/html; charset=utf-8", SCRIPT: "text/javascript; charset=utf-8"}
    assert answer.headers["content-type"] == types[name]


@given(accepted=st.text("brgzipq=;,.*019 \t-x", max_size=40))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
async def test_no_header_keeps_the_page_away(page, accepted):
    answer, body = await raw(page, SCRIPT, Accept_Encoding=accepted)
    assert answer.status_code == 200
    coding = answer.headers.get("content-encoding")
    assert coding is None or coding in accepted or "*" in accepted
    assert READERS[coding](body) == TEXTS[SCRIPT]


async def test_what_has_no_smaller_form_comes_plain(page):
    for name, data in ONLY_PLAIN.items():
        answer, body = await raw(page, name, Accept_Encoding="br, gzip")
        assert (body, answer.headers.get("content-encoding")) == (data, None)
        assert "vary" not in answer.headers


async def test_names_with_hashes_are_kept_for_ever_and_the_index_is_asked_for_anew(page):
    for name in (SCRIPT, SHEET, PICTURE):
        answer, _ = await raw(page, name)
        assert answer.headers["cache-control"] == FOR_EVER
    for name in ("", "index.html"):
        answer, body = await raw(page, name)
        assert answer.headers["cache-control"] == "no-cache"
        assert body == TEXTS["index.html"]
    missing, _ = await raw(page, "assets/index-00000000.js")
    assert missing.status_code == 404 and "cache-control" not in missing.headers


async def test_a_form_that_the_browser_has_is_not_sent_again(page):
    tags = set()
    for accepted in ("", "gzip", "br"):
        first, _ = await raw(page, "", Accept_Encoding=accepted)
        tags.add(first.headers["etag"])
        again, body = await raw(
            page, "", Accept_Encoding=accepted, If_None_Match=f'"x", {first.headers["etag"]}'
        )
        assert (again.status_code, body) == (304, b"")
        assert again.headers["vary"] == "Accept-Encoding"
        assert again.headers["cache-control"] == "no-cache"
    assert len(tags) == 3  # none may be taken for another


async def test_another_page_of_the_same_size_and_second_is_another_page(tmp_path, monkeypatch):
    answers = []
    for version in ("a", "b"):
        folder = tmp_path / version
        folder.mkdir()
        (folder / "index.html").write_text(f"<script src={version}>")
        os.utime(folder / "index.html", (1.58e9, 1.58e9))  # as all files of a wheel
        kept = {}
        if answers:
            told = answers[0].headers
            kept = {"If_None_Match": told["etag"]}
            kept |= {
                "If_Modified_Since": told.get("last-modified", "Sun, 02 Feb 2020 00:00:00 GMT")
            }
        answer, body = await raw(client(folder, monkeypatch), "", **kept)
        assert (answer.status_code, body) == (200, f"<script src={version}>".encode())
        answers.append(answer)


async def test_nothing_is_looked_for_on_behalf_of_who_has_left(folder, monkeypatch):
    files, sent = PageFiles(folder), []
    monkeypatch.setattr(files, "lookup_path", lambda _: pytest.fail("looked for"))

    async def receive():
        return {"type": "http.disconnect"}

    async def send(message):
        sent.append(message)

    scope = {"type": "http", "method": "GET", "path": "/", "headers": [], "root_path": ""}
    await files(scope, receive, send)
    assert sent == []


async def test_a_file_is_handed_over_in_pieces_that_wait_for_their_reader(tmp_path):
    whole = bytes(range(256)) * 1000
    (tmp_path / "script.js").write_bytes(whole)
    sent = []

    async def receive():
        await asyncio.Event().wait()

    async def send(message):
        sent.append(message)

    scope = {"type": "http", "method": "GET", "path": "/script.js", "headers": [], "root_path": ""}
    await PageFiles(tmp_path)(scope | {"asgi": {"spec_version": "2.4"}}, receive, send)
    pieces = [message.get("body", b"") for message in sent]
    assert b"".join(pieces) == whole and max(map(len, pieces)) <= PIECE
    assert (b"content-length", b"256000") in sent[0]["headers"]


async def test_who_asks_for_a_part_gets_the_whole_as_http_allows(page):
    whole, body = await raw(page, SCRIPT, Accept_Encoding="gzip")
    same, again = await raw(
        page, SCRIPT, Accept_Encoding="gzip", Range="bytes=5-9", If_Range=whole.headers["etag"]
    )
    assert (same.status_code, again) == (200, body)


async def test_compressed_files_have_no_address_of_their_own(page):
    for suffix in (".gz", ".br"):
        answer, _ = await raw(page, SCRIPT + suffix)
        assert answer.status_code == 404


@pytest.mark.parametrize("path", ["/a" * 9, "/" + "a" * 512, "/a%2f" + "a%2f" * 8, "/a//" * 5])
async def test_a_path_longer_than_any_of_the_page_is_not_looked_for(page, monkeypatch, path):
    monkeypatch.setattr(PageFiles, "lookup_path", lambda *_: pytest.fail("the disk is asked"))
    assert (await page.get(path)).status_code == 404


async def test_a_page_that_was_built_without_them_is_served_plain(tmp_path, monkeypatch):
    (tmp_path / "index.html").write_bytes(TEXTS["index.html"])
    answer, body = await raw(client(tmp_path, monkeypatch), "", Accept_Encoding="br, gzip")
    assert (answer.status_code, body) == (200, TEXTS["index.html"])
    assert "content-encoding" not in answer.headers


async def test_no_file_is_an_answer_to_a_websocket(folder):
    sent = []

    async def send(message):
        sent.append(message["type"])

    await PageFiles(folder)({"type": "websocket", "path": "/assets/x"}, None, send)
    assert sent == ["websocket.close"]
