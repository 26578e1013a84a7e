"""The server of the studio page: who is let in, what is taken, and that deleting is deleting."""

import errno
from pathlib import Path
from types import SimpleNamespace

import pytest
from PIL import Image
from starlette.testclient import TestClient

from ico3d.bundle.format import Bundle
from ico3d.chat.serving.sites import Sites
from ico3d.cli import main
from ico3d.creating.settings import QUALITIES
from ico3d.errors import StorageError
from ico3d.recording import app as server
from ico3d.recording.guiding import looking
from ico3d.recording.keeping.body_choice import HEAD_ALONE
from ico3d.recording.keeping.person import Person
from ico3d.recording.keeping.plan import scripts
from ico3d.recording.making.makers import Bodies
from ico3d.recording.making.places import Places
from ico3d.recording.making.progress import FACE, Progress, write_progress
from support.needs import needs
from support.strangers.empty_pictures import write_empty_pictures
from support.studio_page.looks import look_once
from support.studio_page.parts import part_file

pytestmark = [needs("av"), pytest.mark.slow]
KEY = "abcd-efgh-ijkl-mnop"
HOME = "http://127.0.0.1:8766"


@pytest.fixture(autouse=True)
def blind(tmp_path, monkeypatch):
    """A machine without models."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("ICO3D_MODELS", raising=False)


@pytest.fixture(autouse=True)
def looked_at_once(monkeypatch):
    """A part that an earlier test had looked at is not looked at again."""
    look_once(monkeypatch)


@pytest.fixture
def room(tmp_path):
    return server.open_room(tmp_path / "recordings", "127.0.0.1", False)


def _client(room, sites=None, **headers):
    app = server.make_app(room, "127.0.0.1", sites or Sites())
    return TestClient(app, HOME, headers=headers, raise_server_exceptions=False)


@pytest.fixture
def video(tmp_path):
    return part_file(tmp_path / "part.mp4", 10).read_bytes()


@pytest.fixture
def page(room, video):
    """The page of somebody who agreed, by a tick and aloud."""
    client = _client(room)
    agreed = client.post("/recordings/Ida", json={"agreed": True, "language": "de"})
    assert agreed.status_code == 201
    for id in ("text-1", "upload"):
        assert _send(client, id, video).json()["code"] == "unspoken"
    assert _send(client, "consent", video).status_code == 200
    return client


def _send(page, id, data, take="a1", size=1000):
    for at in range(0, len(data), size):
        answer = page.post(
            f"/recordings/Ida/takes/{id}/{take}",
            params={"offset": at},
            content=data[at : at + size],
        )
        if answer.status_code != 200:
            return answer
    return page.post(f"/recordings/Ida/takes/{id}/{take}/keep")


def _state(status, id):
    return next(part for part in status["parts"] if part["id"] == id)["state"]


def test_nothing_is_recorded_before_somebody_agreed(room, video):
    client = _client(room)
    assert client.get("/recordings/").json()["people"] == []
    refused = client.post("/recordings/Ida", json={"agreed": "yes", "language": "de"})
    assert (refused.status_code, refused.json()["code"]) == (403, "consent")
    assert _send(client, "left", video).json()["code"] == "unknown"
    assert list(room.people.folder.iterdir()) == []


def test_nobody_is_asked_for_their_voice_unless_it_is_wanted(room):
    client = _client(room)
    shown = client.get("/recordings/").json()
    assert (shown["voice"], shown["mute"]) == ({}, False)
    client.post("/recordings/Ida", json={"agreed": True, "language": "en", "voice": True})
    assert "voice_consent" not in room.people.person("Ida").consent()


def test_a_voice_is_agreed_to_by_a_tick_of_its_own(tmp_path, monkeypatch):
    room = server.open_room(tmp_path / "recordings", "127.0.0.1", False, voices=True)
    client = _client(room)
    for lacking in ("openvoice is missing.", ""):
        monkeypatch.setattr(server, "hindrance", lambda lacking=lacking: lacking)
        shown = client.get("/recordings/").json()
        assert shown["mute"] == bool(lacking)
    assert shown["voice"].keys() == shown["consent"].keys() == scripts().keys()
    form = {"agreed": True, "language": "zh"}
    for name, ticks in (("Ida", {"voice": True}), ("Ada", {"voice": "yes"}), ("Eve", {})):
        status = client.post(f"/recordings/{name}", json=form | ticks).json()
        told, agreed = status["parts"][0]["text"], room.people.person(name).consent()
        face = shown["consent"]["zh"].format(name=name)
        assert told == face + (shown["voice"]["zh"] if name == "Ida" else "")
        assert ("voice_consent" in agreed) == (name == "Ida")
    german = client.post("/recordings/Bob", json={"agreed": True, "language": "de", "voice": True})
    said = german.json()["parts"][0]["text"]
    assert said.endswith(f"entsteht. {shown['voice']['de']}")


def test_parts_arrive_in_pieces_and_are_shown_and_removed(page, room, video):
    kept = _send(page, "text-1", video).json()
    assert _state(kept, "text-1") == "kept" and _state(kept, "text-2") == "missing"
    assert kept["parts"][0]["text"].startswith("Ich bin Ida. Ich bin einverstanden")
    assert (
        _state(kept, "consent") == "kept"
        and kept["covered"]["sounds"] > 10
        and kept["making"] is None
        and not kept["avatar"]
    )
    shown = page.get("/recordings/Ida/parts/text-1")
    assert (shown.content, shown.headers["content-type"]) == (video, "video/mp4")
    assert shown.headers["cache-control"] == "no-store"
    gone = page.delete("/recordings/Ida/parts/text-1").json()
    assert _state(gone, "text-1") == "missing"
    assert page.get("/recordings/Ida/parts/text-1").status_code == 404


def test_a_file_that_is_no_video_is_gone_and_nothing_else(page, room, video):
    _send(page, "text-1", video)
    for data in (b"not at all", video[:60]):
        answer = _send(page, "upload", data)
        assert (answer.status_code, answer.json()["code"]) == (415, "no-video")
    parts = room.people.folder / "Ida" / "parts"
    names = {file.name for file in parts.iterdir() if not file.name.startswith("consent")}
    assert names == {"text-1.json", "text-1.mp4"}


def test_a_video_of_which_nothing_can_be_made_is_gone_and_an_earlier_one_stays(
    page, room, video, tmp_path
):
    assert _send(page, "upload", video).status_code == 200
    mute = part_file(tmp_path / "mute.mp4", 10, sound=False).read_bytes()
    answer = _send(page, "upload", mute, take="b2")
    told = answer.json()
    assert (answer.status_code, told["code"]) == (422, "unusable")
    assert told["error"].startswith("the video has no sound")
    (advice,) = told["advice"]
    assert (advice["code"], advice["level"]) == ("sound-none", "refused")
    parts = room.people.folder / "Ida" / "parts"
    assert sorted(file.name for file in parts.glob("upload.*")) == ["upload.json", "upload.mp4"]
    assert (parts / "upload.mp4").read_bytes() == video


def test_a_video_that_takes_too_much_is_gone(page, room, tmp_path, monkeypatch):
    monkeypatch.setattr(looking, "SECONDS", 0.5)  # or what is left of a second
    monkeypatch.setattr(looking, "SECONDS_PER_MEGABYTE", 0.0)
    write_empty_pictures(tmp_path / "costly.mkv", 400)
    answer = _send(page, "left", (tmp_path / "costly.mkv").read_bytes(), size=1 << 20)
    assert (answer.status_code, answer.json()["code"]) == (422, "costly")
    assert not list((room.people.folder / "Ida" / "parts").glob("left*"))
    assert page.get("/recordings/Ida").status_code == 200


def test_a_body_is_chosen_and_kept_with_the_recording(page, room):
    shown = page.get("/recordings/").json()
    assert shown["builds"] == ["slender", "medium", "sturdy"]
    assert (shown["outfits"], shown["packaged"]) == (["recorded", "navy", "wine"], True)
    alone = {"wanted": False, "build": "medium", "outfit": "recorded"}
    assert page.get("/recordings/Ida").json()["body"] == alone
    choice = {"wanted": True, "build": "slender", "outfit": "wine"}
    assert page.put("/recordings/Ida/body", json=choice).json()["body"] == choice
    assert _client(room).get("/recordings/Ida").json()["body"] == choice  # after a restart, too
    for wrong in ({}, choice | {"build": "huge"}, choice | {"wanted": 1}, choice | {"outfit": []}):
        answer = page.put("/recordings/Ida/body", json=wrong)
        assert (answer.status_code, answer.json()["code"]) == (400, "body")
    assert page.get("/recordings/Ida").json()["body"] == choice
    for damaged in ("[]", "[" * 100_000):
        (room.people.folder / "Ida" / "body.json").write_text(damaged)
        assert page.get("/recordings/Ida").json()["body"] == alone
    assert page.put("/recordings/Eve/body", json=choice).json()["code"] == "unknown"


def test_a_body_that_cannot_look_so_is_refused_before_the_making(tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(
        Bundle, "open", lambda file, see=Bundle.open: opened.append(file) or see(file)
    )
    missing = Bodies(tmp_path / "nobody.ico3d", HEAD_ALONE)
    room = server.open_room(tmp_path / "recordings", "127.0.0.1", False, missing)
    client = _client(room)
    client.post("/recordings/Ida", json={"agreed": True, "language": "de"})
    assert client.get("/recordings/").json()["packaged"] is False
    choice = {"wanted": True, "build": "slender", "outfit": "wine"}
    for _ in range(3):
        answer = client.put("/recordings/Ida/body", json=choice)
        assert answer.status_code == 500 and "nobody.ico3d" in answer.json()["error"]
    assert len(opened) == 1  # it takes a second, and who asks may ask again and again
    assert client.put("/recordings/Ida/body", json=choice | {"wanted": False}).status_code == 200


def test_what_was_made_so_far_is_discarded_and_the_recordings_stay(page, room, video):
    _send(page, "text-1", video)
    folder = Places(room.people.folder / "Ida").folder
    folder.mkdir()
    write_progress(folder, Progress("stopped", "quick", "learn", 0.4))
    made = page.get("/recordings/Ida").json()["making"]
    assert (made["state"], made["changed"]) == ("stopped", ["parts", "on"])
    assert "made_of" not in made
    gone = page.delete("/recordings/Ida/making", params={"discard": True}).json()
    assert gone["making"] is None and _state(gone, "text-1") == "kept" and not folder.exists()


def test_the_time_left_that_is_shown_counts_down_without_a_report(page, room, monkeypatch):
    folder = Places(room.people.folder / "Ida").folder
    folder.mkdir()
    running = Progress("running", "quick", "track", left=300.0, later=100.0, told=1000.0)
    monkeypatch.setattr(room.makers, "progress", lambda _: running)
    for now, left in ((1000.0, 300.0), (1060.0, 240.0), (5000.0, 100.0)):
        monkeypatch.setattr(server, "time", SimpleNamespace(time=lambda now=now: now))
        shown = page.get("/recordings/Ida").json()["making"]
        assert shown["left"] == left and not {"later", "told"} & shown.keys()


def test_each_quality_says_how_long_it_takes_once_the_machine_is_known(page, room, video):
    assert page.get("/recordings/Ida").json()["durations"] == {}
    room.durations._step = 0.02
    assert page.get("/recordings/Ida").json()["durations"] == {}  # nothing is recorded
    durations = _send(page, "text-1", video).json()["durations"]
    assert list(durations) == list(QUALITIES)
    assert 0 < durations["quick"] < durations["good"] < durations["best"]


def test_the_machine_is_measured_as_long_as_the_server_runs(room, monkeypatch):
    done = []
    for name in ("begin", "close"):
        monkeypatch.setattr(room.durations, name, lambda name=name: done.append(name))
    with _client(room):
        assert done == ["begin"]
    assert done == ["begin", "close"]


def test_the_consent_that_is_taken_back_takes_along_what_is_being_made(page, room, video):
    _send(page, "text-1", video)
    places = Places(room.people.folder / "Ida")
    places.folder.mkdir()
    places.joined.touch()
    write_progress(places.folder, Progress("running", "quick", "learn", 0.4))
    status = page.delete("/recordings/Ida/parts/consent").json()
    assert _state(status, "consent") == "missing" and not places.joined.exists()
    assert status["making"]["state"] == "stopped"


def test_a_form_nested_deep_is_none(page):
    answer = page.post("/recordings/Ida/making", content=b"[" * 4000)
    assert (answer.status_code, answer.json()["code"]) == (400, "quality")


def test_requests_are_bounded(page, monkeypatch):
    monkeypatch.setattr(server, "LARGEST_CHUNK", 100)
    monkeypatch.setattr(server, "LARGEST_PICTURE", 100)
    big = bytes(101)
    answers = [
        page.post("/recordings/Ida/takes/left/a1", params={"offset": 0}, content=big),
        page.post("/recordings/Ida/look", content=big),
        page.post("/recordings/Ida/making", content=bytes(5000)),
    ]
    assert [answer.status_code for answer in answers] == [413] * 3
    assert page.post("/recordings/Ida/look", content=b"x").json()["code"] == "picture"


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space"), StorageError("/a/secret")])
def test_a_full_disk_is_one_sentence(page, monkeypatch, video, error):
    def full(*_):
        raise error

    monkeypatch.setattr(Person, "append", full)
    answer = _send(page, "left", video)
    assert (answer.status_code, answer.json()["code"]) == (507, "full")
    assert "secret" not in answer.text


def test_without_a_tracker_the_page_is_told(page):
    assert "face_landmarker.task" in page.get("/recordings/").json()["lacking"]


def test_the_progress_and_the_face_are_shown(page, room):
    folder = Places(room.people.folder / "Ida").folder
    folder.mkdir()
    assert page.get("/recordings/Ida/making/face").status_code == 404
    Image.new("L", (8, 8)).save(folder / FACE)
    write_progress(folder, Progress("made", "quick", "bake", 1.0, faces=2, decibels=30.0))
    made = page.get("/recordings/Ida").json()["making"]
    assert (made["state"], made["faces"], made["decibels"]) == ("made", 2, 30.0)
    assert page.get("/recordings/Ida/making/face").headers["content-type"] == "image/jpeg"
    (folder / FACE).rename(folder / "elsewhere.jpg")
    (folder / FACE).symlink_to(folder / "elsewhere.jpg")
    assert page.get("/recordings/Ida/making/face").status_code == 404
    assert page.post("/recordings/Ida/talk").json()["code"] == "unmade"
    assert page.post("/recordings/Ida/making", json={"quality": "x"}).json()["code"] == "quality"


def test_delete_removes_everything_and_late_pieces_bring_nothing_back(
    page, room, video, monkeypatch
):
    ended: list[Path] = []
    monkeypatch.setattr(room.looks, "end", ended.append)
    _send(page, "text-1", video)
    assert page.delete("/recordings/Ida").status_code == 204
    assert list(room.people.folder.iterdir()) == []
    assert ended == [room.people.folder / "Ida"]
    late = page.post("/recordings/Ida/takes/left/a1", params={"offset": 0}, content=video)
    assert late.json()["code"] == "unknown" and list(room.people.folder.iterdir()) == []


def test_only_the_page_itself_and_who_has_the_key_come_in(room):
    assert _client(room, Origin="http://evil.example").get("/recordings/").status_code == 403
    assert _client(room, Host="evil.example").get("/recordings/").status_code == 403
    sites = Sites(key=KEY)
    client = _client(room, sites)
    for path in ("/recordings/", "/recordings/Ida", "/recordings/Ida/parts/left"):
        assert client.get(path).status_code == 401
    assert client.delete("/recordings/Ida").status_code == 401
    assert client.get("/recordings/", params={"token": "1.2.3"}).status_code == 401
    assert client.post("/token", headers={"Authorization": "Bearer wrong"}).status_code == 401
    token = client.post("/token", headers={"Authorization": f"Bearer {KEY}"}).json()["token"]
    assert client.get("/recordings/", params={"token": token}).json()["people"] == []


def test_the_first_page_is_that_of_the_studio_and_may_ask_for_the_camera(page):
    first = page.get("/?token=1.x", follow_redirects=False)
    assert first.headers["location"] == "studio?token=1.x"
    assert "camera=(self)" in first.headers["permissions-policy"]


def test_what_is_deleted_while_it_is_looked_at_stays_deleted(page, room, video, monkeypatch):
    """Whoever deletes while a part is being kept wins."""

    async def delete(file, id):
        room.people.delete("Ida")
        return {"seconds": 1.0, "turn": None, "advice": []}

    monkeypatch.setattr(room.looks, "report", delete)
    assert _send(page, "left", video).json()["code"] == "unknown"
    assert list(room.people.folder.iterdir()) == []


def test_others_need_https(capsys):
    assert main(["studio", "--host", "0.0.0.0", "--no-browser"]) == 1
    assert "browsers give their camera only to HTTPS pages" in capsys.readouterr().err


def test_what_is_deleted_meanwhile_is_not_there(page, monkeypatch, video):
    def gone(*_):
        raise FileNotFoundError(errno.ENOENT, "No such file or directory")

    monkeypatch.setattr(Person, "append", gone)
    answer = _send(page, "text-1", video)
    assert (answer.status_code, answer.json()["code"]) == (404, "part")
