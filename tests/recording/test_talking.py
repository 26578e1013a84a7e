"""Talks of finished avatars begin one at a time, and hold up nobody else."""

import asyncio
import threading
from datetime import date
from types import SimpleNamespace

import httpx
import pytest

from ico3d.chat.serving.sites import Sites
from ico3d.recording import app as server
from ico3d.recording.making.makers import Bodies
from support.needs import needs

pytestmark = [needs("av"), pytest.mark.slow]
HOME = "http://127.0.0.1:8766"


@pytest.fixture
def room(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    return server.open_room(tmp_path / "recordings", "127.0.0.1", False)


async def test_others_are_answered_while_talks_begin(room, monkeypatch):
    for name in ("Ida", "Ada", "Eve"):
        room.people.begin(name, "de", True, date.today())
    begun = threading.Event()
    starting = SimpleNamespace(url=lambda: "there" if begun.wait(20) else "")
    asked_for = []
    monkeypatch.setattr(room.talks, "begin", lambda file: asked_for.append(file.stem) or starting)
    sending = httpx.ASGITransport(server.make_app(room, "127.0.0.1", Sites()))
    async with httpx.AsyncClient(transport=sending, base_url=HOME) as client:
        asked = [
            f"/recordings/{name}/talk" for name in ("Ida", "Ada", "Ada%20") * 20
        ]  # more than threads
        talks = [asyncio.create_task(client.post(path)) for path in asked]
        await asyncio.sleep(0.2)
        shown = await asyncio.wait_for(client.get("/recordings/"), 5)
        assert shown.json()["people"] == ["Ada", "Eve", "Ida"] and not any(t.done() for t in talks)
        gone = await asyncio.wait_for(client.delete("/recordings/Eve"), 5)
        assert gone.status_code == 204
        begun.set()
        assert {(await talk).text for talk in talks} == {'{"url":"there"}'}
    assert asked_for == ["Ida", "Ada"]  # once each, however their names are spelt


async def test_others_are_answered_while_looks_of_a_body_are_looked_up(room, monkeypatch):
    people = [room.people.begin(f"Ida {n}", "de", True, date.today()).name for n in range(16)]
    found = threading.Event()
    monkeypatch.setattr(Bodies, "check", lambda *_: found.wait(20))
    sending = httpx.ASGITransport(server.make_app(room, "127.0.0.1", Sites()))
    choice = {"wanted": True, "build": "slender", "outfit": "wine"}
    async with httpx.AsyncClient(transport=sending, base_url=HOME) as client:
        asked = [client.put(f"/recordings/{name}/body", json=choice) for name in people]
        chosen = [asyncio.create_task(one) for one in asked]
        await asyncio.sleep(0.2)
        shown = await asyncio.wait_for(client.get("/recordings/Ida 1"), 5)
        assert shown.json()["name"] == "Ida 1" and not any(one.done() for one in chosen)
        found.set()
        assert {(await one).status_code for one in chosen} == {200}


async def test_who_waits_for_one_person_keeps_no_talk_of_another_waiting(room, monkeypatch):
    for name in ("Ida", "Ada"):
        room.people.begin(name, "de", True, date.today())
    monkeypatch.setattr(room.talks, "begin", lambda file: SimpleNamespace(url=lambda: file.stem))
    sending = httpx.ASGITransport(server.make_app(room, "127.0.0.1", Sites()))
    held = room.lock("Ida")  # as a hundred makings and stops hold it in turn
    async with httpx.AsyncClient(transport=sending, base_url=HOME) as client, held:
        talks = [client.post(f"/recordings/{name}/talk") for name in ("Ida", "Ada")]
        answers = await asyncio.wait_for(asyncio.gather(*talks), 20)
    assert [one.json()["url"] for one in answers] == ["Ida", "Ada"]


async def test_a_talk_is_stopped_once_the_files_of_its_person_are_gone(room, monkeypatch):
    room.people.begin("Ida", "de", True, date.today())
    done = []
    monkeypatch.setattr(room.talks, "stop", lambda name: done.append(("stop", name)))
    delete = room.people.delete
    monkeypatch.setattr(
        type(room.people), "delete", lambda _, name: (done.append(("delete", name)), delete(name))
    )
    sending = httpx.ASGITransport(server.make_app(room, "127.0.0.1", Sites()))
    async with httpx.AsyncClient(transport=sending, base_url=HOME) as client:
        assert (await client.delete("/recordings/Ida")).status_code == 204
    assert done == [("delete", "Ida"), ("stop", "Ida")]  # one that began before is known by then
