"""Who asks often that a part be kept, or does not wait for it, holds up nobody else."""

import asyncio
import contextlib
import os
import time
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest

from ico3d.chat.serving.sites import Sites
from ico3d.recording import app as studio
from ico3d.recording.guiding.looking import MOST_AT_ONCE
from ico3d.recording.presence import Playing
from support.chat.serving import running
from support.chat.waiting import until
from support.needs import needs
from support.studio_page.parts import begun, part_file

pytestmark = [needs("av"), pytest.mark.slow]
REPORT = {"seconds": 1.0, "turn": None, "advice": []}
KEEP = b"POST /recordings/%s/takes/%s/keep HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\n\r\n"
TALK = b"POST /recordings/%s/talk HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\n\r\n"
LOOK = b"POST /recordings/Eve/look HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1\r\n\r\nx"


@pytest.fixture
def room(tmp_path, monkeypatch):
    """Recordings of Eve, who has eight takes, and of Bob, who has one."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    folder, data = tmp_path / "people", part_file(tmp_path / "a.mp4").read_bytes()
    room = studio.open_room(folder, "127.0.0.1", False)
    for name, takes in (("Eve", 8), ("Bob", 1)):
        person = begun(folder, name)
        for n in range(takes):
            person.append(f"text-{n % 2 + 1}", f"a{n}", 0, data)
    return room


@pytest.fixture
async def server(room, monkeypatch):
    """The port of a server, the looks that have begun, and what lets them end."""
    looks, may_end = [], asyncio.Event()

    async def report(file, id):
        looks.append((file.parent.parent.name, file.name))
        await may_end.wait()
        return REPORT

    def told(picture, _):
        looks.append(("picture", picture))
        while not may_end.is_set():
            time.sleep(0.01)
        return {"is": "seen"}

    monkeypatch.setattr(room.looks, "report", report)

    def begin(avatar):
        looks.append(("talk", avatar.stem))
        return SimpleNamespace(url=lambda: told(b"url", "")["is"])

    monkeypatch.setattr(room.talks, "begin", begin)
    monkeypatch.setattr(room.eye, "told", told)
    async with running(studio.make_app(room, "127.0.0.1", Sites())) as (_, listener):
        yield listener.getsockname()[1], looks, may_end


async def _ask(port, name, take):
    _, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(KEEP % (name, take))
    await writer.drain()
    return writer


def _held():
    """What this process has open."""
    for link in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # that of this listing
            yield os.readlink(link)


async def _takes(port, name):
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
        parts = (await client.get(f"/recordings/{name}")).json()["parts"]
        return {one["id"]: one["state"] for one in parts if one["state"] != "missing"}


async def test_abandoned_requests_are_looked_at_once_or_not_at_all(server):
    port, looks, may_end = server
    takes = [b"text-%d/a%d" % (n % 2 + 1, n) for n in range(4)]
    asked = [await _ask(port, b"Eve", take) for take in takes for _ in range(15)]
    await until(lambda: len(looks) == MOST_AT_ONCE)
    await asyncio.sleep(0.5)
    for writer in asked:
        writer.close()
    await asyncio.sleep(0.5)
    assert len(looks) == len(set(looks)) == MOST_AT_ONCE  # of 60 requests
    bob = await _ask(port, b"Bob", b"text-1/a0")
    may_end.set()
    async with asyncio.timeout(30):
        while (await _takes(port, "Bob")).get("text-1") != "kept":
            await asyncio.sleep(0.05)
    assert len(looks) == MOST_AT_ONCE + 1 and looks[-1][0] == "Bob"
    assert "kept" in (await _takes(port, "Eve")).values()  # what had begun was not in vain
    bob.close()


async def test_a_person_with_many_parts_keeps_another_waiting_for_one(server):
    port, looks, may_end = server
    takes = [b"text-%d/a%d" % (n % 2 + 1, n) for n in range(4, 8)]
    asked = [await _ask(port, b"Eve", take) for take in takes]
    await until(lambda: len(looks) == MOST_AT_ONCE)
    asked.append(await _ask(port, b"Bob", b"text-1/a0"))
    await asyncio.sleep(0.3)
    may_end.set()
    await until(lambda: len(looks) == 5)
    assert [name for name, _ in looks].index("Bob") <= MOST_AT_ONCE + 1
    for writer in asked:
        writer.close()


async def test_pictures_that_nobody_waits_for_are_not_looked_at(server):
    port, looks, may_end = server
    asked = []
    for _ in range(30):
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(LOOK)
        asked.append(writer)
    await until(lambda: len(looks) > 0)
    await asyncio.sleep(0.5)
    for writer in asked:
        writer.close()
    await asyncio.sleep(0.5)
    may_end.set()
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
        assert (await client.post("/recordings/Bob/look", content=b"x")).json() == {"is": "seen"}
    assert looks == [("picture", b"x")] * 2  # the one that had begun, and Bob's


async def test_talks_that_nobody_waits_for_do_not_begin_and_hold_up_no_deletion(server):
    port, looks, may_end = server
    asked = []
    for name in (b"Eve", *[b"Bob"] * 9):
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(TALK % name)
        asked.append(writer)
        await until(lambda: len(looks) > 0)
    await asyncio.sleep(0.5)
    for writer in asked:
        writer.close()
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=5) as client:
        assert (await client.delete("/recordings/Bob")).status_code == 204
    may_end.set()
    await asyncio.sleep(0.5)
    assert looks == [("talk", "Eve"), ("picture", b"url")]


async def test_what_somebody_does_not_read_is_gone_when_it_is_deleted(server, tmp_path):
    port, _, may_end = server
    may_end.set()
    keeping = await _ask(port, b"Bob", b"text-1/a0")
    async with asyncio.timeout(30):
        while (await _takes(port, "Bob")).get("text-1") != "kept":
            await asyncio.sleep(0.05)
    file = next((tmp_path / "people" / "Bob" / "parts").glob("text-1*.mp4"))
    with file.open("ab") as part:
        part.write(bytes(30_000_000))  # more than a connection holds
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(b"GET /recordings/Bob/parts/text-1 HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
    assert b"200" in await reader.readline()
    await until(lambda: any("text-1" in name for name in _held()))
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=5) as client:
        assert (await client.delete("/recordings/Bob")).status_code == 204
    await until(lambda: not any("text-1" in name for name in _held()))
    for open_one in (writer, keeping):
        open_one.close()


async def test_what_is_removed_before_it_is_opened_breaks_off_in_peace(tmp_path):
    """It was an error of the server, with a trace in its log."""
    file, sent = tmp_path / "text-1.mp4", []
    file.write_bytes(b"0" * 9)
    playing = Playing(file, stat_result=os.stat(file))

    async def receive():
        await asyncio.Event().wait()

    async def send(message):
        sent.append(message["type"])
        file.unlink()  # at the latest moment

    await playing({"type": "http", "method": "GET", "headers": []}, receive, send)
    assert sent == ["http.response.start"]


async def test_all_who_ask_for_one_part_are_told_that_it_is_kept(server):
    port, looks, may_end = server
    url = "/recordings/Bob/takes/text-1/a0/keep"
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
        asked = [asyncio.create_task(client.post(url)) for _ in range(5)]
        await asyncio.sleep(0.5)
        may_end.set()
        answers = await asyncio.gather(*asked)
    assert [one.status_code for one in answers] == [200] * 5 and len(looks) == 1


async def test_parts_that_wait_to_be_kept_hold_up_no_other_look(server, room):
    port, looks, may_end = server
    may_end.set()
    async with room.lock("Eve"):  # as a hundred makings and stops hold it in turn
        asked = [await _ask(port, b"Eve", b"text-%d/a%d" % (n % 2 + 1, n)) for n in range(4)]
        await until(lambda: len(looks) == 4)
        url = f"http://127.0.0.1:{port}/recordings/Bob/takes/text-1/a0/keep"
        async with httpx.AsyncClient(timeout=20) as client:
            assert (await client.post(url)).status_code == 200
    async with asyncio.timeout(30):
        while await _takes(port, "Eve") != {"text-1": "kept", "text-2": "kept"}:
            await asyncio.sleep(0.05)
    for writer in asked:
        writer.close()


async def test_a_body_without_an_end_is_not_read_while_a_part_is_looked_at(server):
    port, looks, _ = server
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(KEEP.replace(b"Length: 0", b"Length: 99999999") % (b"Bob", b"text-1/a0"))
    await until(lambda: len(looks) == 1)
    writer.write(bytes(100_000))
    assert b"413" in await asyncio.wait_for(reader.readline(), 10)
    writer.close()
