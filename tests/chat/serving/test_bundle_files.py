"""How a bundle's files travel: small where that helps, kept where the address has a hash."""

import asyncio
import gc
import gzip
import json
import threading
from dataclasses import replace

import httpx
import pytest
from fastapi import FastAPI, Request

from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import FileEntry
from ico3d.bundle.persona import Persona
from ico3d.chat.serving import bundle_files
from ico3d.chat.serving.bundle_files import AT_ONCE, BundleFiles
from ico3d.chat.serving.page_files import PIECE
from support.chat.serving import TYPED, serving, visiting

FOR_EVER = "public, max-age=31536000, immutable"
HEAD, PICTURE = "head.safetensors", "thumbnail.png"


def client(bundle, persona=None):
    app, files = FastAPI(), BundleFiles(bundle, persona)

    @app.get("/{name:path}")
    async def answer(name: str, request: Request):
        return files.answer(name, request)

    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://page")


async def test_an_address_with_the_hash_is_kept_for_ever(bundle):
    sha256 = bundle.manifest.files[HEAD].sha256
    async with client(bundle) as page:
        named = await page.get(f"/{HEAD}?sha256={sha256}")
        private = await page.get(f"/{HEAD}?sha256={sha256}&token=a.b")
        for other in (
            f"/{HEAD}",
            f"/{HEAD}?sha256={sha256[1:]}0",
            f"/manifest.json?sha256={sha256}",
        ):
            answer = await page.get(other)
            assert answer.status_code == 200 and answer.headers["cache-control"] == "no-cache"
    assert named.content == bundle.read(HEAD)
    assert named.headers["cache-control"] == FOR_EVER
    assert private.headers["cache-control"] == FOR_EVER.replace("public", "private")


@pytest.mark.parametrize("coding", ["gzip", "identity", "gzip;q=0", ""])
async def test_files_are_compressed_where_that_helps_and_is_understood(bundle, coding):
    asked = {"Accept-Encoding": coding}
    async with client(bundle) as page:
        async with page.stream("GET", "/manifest.json", headers=asked) as answer:
            wire = b"".join([part async for part in answer.aiter_raw()])
        picture = await page.get(f"/{PICTURE}", headers=asked)
    assert answer.headers["vary"] == "Accept-Encoding"
    assert ("content-encoding" in answer.headers) == (coding == "gzip")
    plain = gzip.decompress(wire) if coding == "gzip" else wire
    told = json.loads(plain)
    assert bundle.manifest.persona.notes and not told["persona"].pop("notes")  # what it knows
    assert told["persona"].pop("suggestions") == list(bundle.manifest.persona.proposed)
    own = json.loads(bundle.read("manifest.json"))
    del own["persona"]["notes"]
    assert told == own
    assert len(wire) < 0.7 * len(plain) or coding != "gzip"
    assert picture.content == bundle.read(PICTURE)


async def test_who_has_a_file_in_its_coding_is_not_sent_it_again(bundle):
    async with client(bundle) as page:
        for coding, other in (("gzip", "identity"), ("identity", "gzip")):
            tag = (await page.get(f"/{HEAD}", headers={"Accept-Encoding": coding})).headers["etag"]
            asked = {"Accept-Encoding": coding, "If-None-Match": tag}
            again = await page.get(f"/{HEAD}", headers=asked)
            assert again.status_code == 304 and not again.content
            changed = await page.get(f"/{HEAD}", headers=asked | {"Accept-Encoding": other})
            compressed = "content-encoding" in changed.headers
            assert changed.status_code == (200 if tag != changed.headers["etag"] else 304)
            assert compressed == changed.headers["etag"].endswith('.gz"')


async def test_a_persona_file_shows_its_name_and_keeps_its_notes(bundle):
    async with client(bundle, Persona("Ada", "Hello.", ("secret => safe",))) as page:
        shown = (await page.get("/manifest.json", headers={"Accept-Encoding": "gzip"})).json()
    assert shown["persona"] == {
        "name": "Ada",
        "greeting": "Hello.",
        "notes": [],
        "suggestions": ["secret"],
    }


async def test_a_file_that_changed_on_disk_is_an_error_in_one_sentence(bundle, monkeypatch):
    monkeypatch.setattr(bundle, "_archive", type("Archive", (), {"read": lambda *_: b"changed"})())
    async with client(bundle) as page:
        answer = await page.get(f"/{HEAD}")
        assert (await page.get("/nothing")).status_code == 404
    assert answer.status_code == 500 and answer.text.count("\n") == 1


async def test_many_slow_readers_share_one_copy(bundle, monkeypatch):
    read, reads = bundle.read, []
    monkeypatch.setattr(bundle, "read", lambda name: reads.append(name) or read(name))
    files = BundleFiles(bundle, None)
    scope = {"type": "http", "headers": [], "query_string": b"", "path": "/"}
    slow = [files.answer(HEAD, Request(scope)).body_iterator for _ in range(50)]
    first = [await anext(pieces) for pieces in slow]
    assert reads == [HEAD] and max(map(len, first)) <= PIECE
    assert first[0] + b"".join([piece async for piece in slow[0]]) == read(HEAD)
    del slow, first
    gc.collect()
    await asyncio.sleep(0.1)  # the loop closes what was left amid its pieces
    files.answer(HEAD, Request(scope))
    assert reads == [HEAD, HEAD]  # nothing is kept that nobody is sent


class ManyFiles:
    """A bundle with as many files of zeros as long recordings have."""

    names = tuple(f"body/{i:04d}.safetensors" for i in range(40))
    manifest = replace(Bundle.open("demo").manifest, files={n: FileEntry(n, 1000) for n in names})

    def read(self, name):
        return bytes(1000)


def test_however_many_files_there_are_each_is_compressed_once(monkeypatch):
    compress, sizes = gzip.compress, []
    monkeypatch.setattr(
        gzip, "compress", lambda d, *o, **k: sizes.append(len(d)) or compress(d, *o, **k)
    )
    files = BundleFiles(ManyFiles(), None)
    scope = {"headers": [(b"accept-encoding", b"gzip")], "query_string": b"", "path": "/"}
    for name in 3 * ManyFiles.names:
        answer = files.answer(name, Request({"type": "http", **scope}))
        assert answer.headers["content-encoding"] == "gzip"
    assert sizes == 40 * [1000]


def test_what_finds_no_room_is_sent_as_it_is(monkeypatch):
    monkeypatch.setattr(bundle_files, "KEPT_BYTES", 1010)
    files = BundleFiles(ManyFiles(), None)
    scope = {"headers": [(b"accept-encoding", b"gzip")], "query_string": b"", "path": "/"}
    asked = [files.answer(n, Request({"type": "http", **scope})) for n in ManyFiles.names[:2]]
    assert ["content-encoding" in answer.headers for answer in asked] == [True, False]


async def test_who_asks_for_files_leaves_threads_to_voices(bundle, monkeypatch):
    answer, reading, most = BundleFiles.answer, [], []

    def slow(files, name, request):
        reading.append(name)
        most.append(len(reading))
        threading.Event().wait(0.02)
        reading.pop()
        return answer(files, name, request)

    monkeypatch.setattr(BundleFiles, "answer", slow)
    async with serving(bundle, TYPED) as (url, _), visiting(url) as page:
        answers = await asyncio.gather(*[page.get(f"bundle/{HEAD}") for _ in range(20)])
    assert [a.status_code for a in answers] == 20 * [200]
    assert max(most) == AT_ONCE


async def test_nothing_is_read_for_who_has_left(bundle, monkeypatch):
    async def left():
        return {"type": "http.disconnect"}

    monkeypatch.setattr(bundle, "read", lambda name: pytest.fail(name))
    scope = {"type": "http", "headers": [], "query_string": b"", "path": "/"}
    assert (await BundleFiles(bundle, None).serve(HEAD, Request(scope, left))).status_code == 499
