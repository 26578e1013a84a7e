"""The application behind the studio page: recordings, guidance, the making of avatars."""

import asyncio
import contextlib
import os
import time
from collections import defaultdict
from collections.abc import AsyncIterator
from dataclasses import dataclass
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse, RedirectResponse

from ico3d.chat.serving.guard import Guard
from ico3d.chat.serving.server import add_page
from ico3d.chat.serving.sites import Sites, add_tokens
from ico3d.common.files import FULL
from ico3d.common.typed import loose_json, plain
from ico3d.creating.settings import QUALITIES
from ico3d.creating.voice.clone import hindrance
from ico3d.errors import Ico3dError, StorageError
from ico3d.recording.guiding.coverage import covered
from ico3d.recording.guiding.fair_queue import FairQueue
from ico3d.recording.guiding.looking import MOST_AT_ONCE, Looks
from ico3d.recording.guiding.seeing import Eye, turn_of
from ico3d.recording.keeping.body_choice import BUILDS, OUTFITS, as_form, chosen, write_choice
from ico3d.recording.keeping.people import People
from ico3d.recording.keeping.person import VOICE_CONSENT, Person
from ico3d.recording.keeping.plan import CONSENT, part_ids, scripts
from ico3d.recording.making.durations import Durations
from ico3d.recording.making.makers import PACKAGED, Bodies, Makers
from ico3d.recording.making.places import Places
from ico3d.recording.making.progress import shown_face
from ico3d.recording.making.sources import Recorded
from ico3d.recording.making.talks import Talks
from ico3d.recording.presence import Playing, while_there
from ico3d.recording.refusals import Refused, full_disk

ROOT = "/recordings/"
LARGEST_CHUNK, LARGEST_PICTURE, LARGEST_FORM = 8 << 20, 1 << 20, 4096
"""Bytes of a request: a chunk of a part, a picture for guidance, a form."""
TYPES = {".webm": "video/webm", ".mp4": "video/mp4", ".avi": "video/x-msvideo"}
UNSPACED = {"zh", "ja"}
"""Languages without a space between sentences."""
NEVER_KEPT = {"Cache-Control": "no-store"}


@dataclass(frozen=True)
class Room:
    """What the routes share.

    Attributes:
        people: The recordings.
        eye: The face tracker, for pictures of the camera.
        glances: Has it look at one picture at a time.
        looks: Processes that look at parts.
        queue: Has them look at a few parts at a time, and keeps the parts.
        bodies: Which bodies avatars may get.
        makers: Processes that make avatars.
        talks: Servers of finished avatars.
        durations: How long avatars take on this machine.
        voices: Whether people are asked if their voice may be cloned, too.
        locks: One for each person, so that nothing is written while something is deleted.
    """

    people: People
    eye: Eye
    glances: FairQueue
    looks: Looks
    queue: FairQueue
    bodies: Bodies
    makers: Makers
    talks: Talks
    durations: Durations
    voices: bool
    locks: defaultdict[str, asyncio.Lock]

    def lock(self, name: str) -> asyncio.Lock:
        """What whoever writes or deletes files of a person has to hold.

        Raises:
            Refused: If there is nobody of this name.
        """
        return self.locks[self.people.person(name).name]


def make_app(room: Room, host: str, sites: Sites, names: tuple[str, ...] = ()) -> Guard:
    """The application of the server.

    Args:
        room: What it serves.
        host: Address to which it is bound.
        sites: Says whether a key is asked for.
        names: Further host names of the server.
    """

    @contextlib.asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await asyncio.to_thread(room.makers.go_on)
        room.durations.begin()
        yield
        await asyncio.to_thread(room.durations.close)
        await asyncio.to_thread(room.makers.close)
        await asyncio.to_thread(room.people.close)
        await asyncio.to_thread(room.talks.close)
        await asyncio.to_thread(room.looks.close)
        room.eye.close()

    app = FastAPI(lifespan=lifespan, docs_url=None, redoc_url=None, openapi_url=None)
    app.add_exception_handler(Ico3dError, _refuse)
    app.add_exception_handler(OSError, _refuse)
    _add_people(app, room)
    _add_parts(app, room)
    _add_making(app, room)
    add_tokens(app, sites)

    @app.get("/")
    async def first(request: Request) -> Response:
        query = f"?{request.url.query}" if request.url.query else ""
        return RedirectResponse(f"studio{query}")

    add_page(app)
    return Guard(app, host, sites, names, camera=True)


async def _refuse(request: Request, error: Exception) -> Response:
    """An error as one sentence."""
    del request
    if isinstance(error, FileNotFoundError):  # somebody deleted it meanwhile
        error = Refused("part", "this is not there any more.", 404)
    elif isinstance(error, StorageError) or getattr(error, "errno", None) in FULL:
        error = full_disk()
    elif isinstance(error, OSError):
        raise error
    told = error if isinstance(error, Refused) else Refused("", str(error), 500)
    shown = {"code": told.code, "error": str(told), "advice": [plain(one) for one in told.advice]}
    return JSONResponse(shown, told.status, NEVER_KEPT)


def _add_people(app: FastAPI, room: Room) -> None:
    """Whose recordings there are; a new one; everything of one gone."""

    @app.get(ROOT)
    async def overview() -> Response:
        shown = {
            "people": await asyncio.to_thread(room.people.names),
            "consent": {language: one.consent for language, one in scripts().items()},
            "qualities": list(QUALITIES),
            "builds": BUILDS,
            "outfits": OUTFITS,
            "packaged": room.bodies.is_packaged,
            "lacking": room.eye.lacking,
            "voice": {language: one.voice for language, one in scripts().items()}
            if room.voices
            else {},
            "mute": bool(room.voices and await asyncio.to_thread(hindrance)),
        }
        return JSONResponse(shown, headers=NEVER_KEPT)

    @app.post(ROOT + "{name}")
    async def begin(name: str, request: Request) -> Response:
        form = await _form(request)
        agreed = form.get("agreed") is True
        voice = room.voices and form.get("voice") is True
        about = (name, str(form.get("language")), agreed, date.today(), voice)
        person = await asyncio.to_thread(room.people.begin, *about)
        return JSONResponse(await asyncio.to_thread(_status, room, person), 201)

    @app.get(ROOT + "{name}")
    async def status(name: str) -> Response:
        person = room.people.person(name)
        shown = await asyncio.to_thread(_status, room, person)
        return JSONResponse(shown, headers=NEVER_KEPT)

    @app.delete(ROOT + "{name}")
    async def delete(name: str) -> Response:
        person = room.people.person(name)
        async with room.lock(name):
            await asyncio.to_thread(room.makers.stop, person)
            await asyncio.to_thread(room.people.delete, person.name)
            await asyncio.to_thread(room.talks.stop, person.name)  # none begins without a file
            await asyncio.to_thread(room.looks.end, person.folder)
        return Response(status_code=204)


def _add_parts(app: FastAPI, room: Room) -> None:
    """The parts of a recording, as they are recorded, kept, seen, and removed."""
    takes, part = ROOT + "{name}/takes/{id}/{take}", ROOT + "{name}/parts/{id}"

    @app.post(takes)
    async def append(name: str, id: str, take: str, offset: int, request: Request) -> Response:
        data = await _body(request, LARGEST_CHUNK)
        async with room.lock(name):
            person = room.people.person(name)
            if id != CONSENT:
                await asyncio.to_thread(person.check_spoken)
            with room.people.room_for(len(data)):
                size = await asyncio.to_thread(person.append, id, take, offset, data)
        return JSONResponse({"size": size})

    @app.post(takes + "/keep")
    async def keep(name: str, id: str, take: str, request: Request) -> Response:
        person = room.people.person(name)
        file = person.unfinished(id, take)

        async def look_at_it() -> Any:
            try:
                return await room.looks.report(file, id)
            except Refused as error:
                if error.code in ("no-video", "costly", "unusable"):
                    person.discard(id, take)
                raise

        async def keep_it(report: Any) -> None:
            async with room.lock(name):
                room.people.person(name)  # may be deleted by now
                await asyncio.to_thread(person.keep, id, take, report)

        await while_there(request, room.queue.done(person.name, file, look_at_it, keep_it))
        return JSONResponse(await asyncio.to_thread(_status, room, person))

    @app.get(part)
    async def play(name: str, id: str) -> Response:
        found = await asyncio.to_thread(room.people.person(name).part, id)
        if found is None:
            raise Refused("part", "this part is not recorded.", 404)
        kind, about = TYPES.get(found.file.suffix, "video/webm"), os.stat(found.file)
        return Playing(found.file, media_type=kind, headers=NEVER_KEPT, stat_result=about)

    @app.delete(part)
    async def remove(name: str, id: str) -> Response:
        async with room.lock(name):
            person = room.people.person(name)
            await asyncio.to_thread(room.makers.withdraw, person, id)
        return JSONResponse(await asyncio.to_thread(_status, room, person))

    @app.post(ROOT + "{name}/look")
    async def look(name: str, request: Request, part: str = "") -> Response:
        person = room.people.person(name)
        picture = await _body(request, LARGEST_PICTURE)
        see = partial(asyncio.to_thread, room.eye.told, picture, turn_of(part))
        told = await while_there(request, room.glances.done(person.name, object(), see))
        return JSONResponse(plain(told))


def _add_making(app: FastAPI, room: Room) -> None:
    """The making of an avatar, its progress, and the talk at its end."""
    making = ROOT + "{name}/making"
    checking, beginning = FairQueue(1), FairQueue(1)  # threads for seconds, which others need, too

    @app.put(ROOT + "{name}/body")
    async def choose(name: str, request: Request) -> Response:
        choice, whose = chosen(await _form(request)), room.people.person(name).name
        check = partial(asyncio.to_thread, room.bodies.check, choice)
        await while_there(request, checking.done(whose, choice, check))
        async with room.lock(name):
            person = room.people.person(name)  # may be deleted by now
            await asyncio.to_thread(write_choice, person.folder, choice)
        return JSONResponse(await asyncio.to_thread(_status, room, person))

    @app.post(making)
    async def make(name: str, request: Request) -> Response:
        form = await _form(request)
        how = str(form.get("quality")), form.get("anew") is True
        person = room.people.person(name)
        async with room.lock(name):
            await asyncio.to_thread(room.makers.begin, person, *how)  # unless it is refused
            await asyncio.to_thread(room.talks.stop, person.name)
        return JSONResponse(await asyncio.to_thread(_status, room, person))

    @app.delete(making)
    async def stop(name: str, discard: bool = False) -> Response:
        person = room.people.person(name)
        end = room.makers.discard if discard else room.makers.stop
        async with room.lock(name):
            await asyncio.to_thread(end, person)
        return JSONResponse(await asyncio.to_thread(_status, room, person))

    @app.get(making + "/face")
    async def face(name: str) -> Response:
        folder = Places(room.people.person(name).folder).folder
        picture = await asyncio.to_thread(shown_face, folder)
        if picture is None:
            raise Refused("part", "there is no picture yet.", 404)
        return Response(picture, media_type="image/jpeg", headers=NEVER_KEPT)

    @app.post(ROOT + "{name}/talk")
    async def talk(name: str, request: Request) -> Response:
        whose = room.people.person(name).name  # however it is spelt in the address

        async def begin() -> str:
            avatar = Places(room.people.person(name).folder).avatar
            talk = await asyncio.to_thread(room.talks.begin, avatar)
            return await asyncio.to_thread(talk.url)  # whoever deletes it meanwhile ends it

        return JSONResponse(
            {"url": await while_there(request, beginning.done(whose, whose, begin))}
        )


def _status(room: Room, person: Person) -> dict[str, Any]:
    """All that the page shows of a person."""
    recorded = Recorded.of(person)
    language, found = recorded.language, recorded.parts
    script = scripts()[language]
    texts = {f"text-{n}": one.text for n, one in enumerate(script.texts, 1)}
    texts[CONSENT] = script.consent.format(name=person.name)
    if VOICE_CONSENT in recorded.consent:
        texts[CONSENT] += ("" if language in UNSPACED else " ") + script.voice
    parts = [
        {"id": id, "text": texts.get(id, script.aloud)} | _of_part(found.get(id))
        for id in (*part_ids(language), "upload")
    ]
    return {
        "name": person.name,
        "language": language,
        "parts": parts,
        "covered": plain(covered(found.values(), language)),
        "making": _of_making(room, person, recorded),
        "durations": dict(room.durations.of(recorded)),
        "body": as_form(room.bodies.choice(person)),
        "avatar": os.path.isfile(Places(person.folder).avatar),
    }


def _of_making(room: Room, person: Person, recorded: Recorded) -> dict[str, Any] | None:
    """What the page shows of a making, with what has changed since it began."""
    progress = room.makers.progress(person)
    if progress is None:
        return None
    shown = plain(progress) | {"left": progress.left_at(time.time())}
    for name in ("made_of", "later", "told"):
        del shown[name]
    return shown | {"changed": room.makers.changed(person, progress, recorded)}


def _of_part(part: Any) -> dict[str, Any]:
    """What the page shows of a part."""
    if part is None:
        return {"state": "missing"}
    if part.report is None:
        return {"state": "broken", "take": part.take}
    return {"state": "kept"} | part.report


async def _body(request: Request, most: int) -> bytes:
    """The body of a request.

    Raises:
        Refused: If it is larger than `most` bytes.
    """
    data = bytearray()
    async for piece in request.stream():
        data += piece
        if len(data) > most:
            raise Refused("large", "this is more than is taken at once.", 413)
    return bytes(data)


async def _form(request: Request) -> dict[str, Any]:
    """The JSON object of a request; empty where there is none.

    Raises:
        Refused: If it is large.
    """
    try:
        form = loose_json(await _body(request, LARGEST_FORM))
    except ValueError:
        return {}
    return form if isinstance(form, dict) else {}


def open_room(
    folder: Path, host: str, tls: bool, bodies: Bodies = PACKAGED, voices: bool = False
) -> Room:
    """What a server of the studio page shares.

    Args:
        folder: Where the recordings are.
        host: Address to which it is bound.
        tls: Whether it serves by HTTPS.
        bodies: Which bodies avatars may get.
        voices: Whether people are asked if their voice may be cloned, too.
    """
    people = People(folder)
    people.clear()
    makers = Makers(people, bodies)
    servers = makers, Talks(host, tls), Durations(makers.is_busy)
    seeing = Eye(), FairQueue(1), Looks(), FairQueue(MOST_AT_ONCE)
    return Room(people, *seeing, bodies, *servers, voices, defaultdict(asyncio.Lock))
