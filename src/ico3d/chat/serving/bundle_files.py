"""Serves the files of a bundle, compressed where that helps and with caching.

An address with `?sha256=HASH` names one content for ever, so browsers keep that content; at an
address without a hash they ask again, and get 304 while the file is the same.
"""

import asyncio
import gzip
from dataclasses import replace
from pathlib import Path
from weakref import WeakValueDictionary

from fastapi import Request, Response
from fastapi.responses import PlainTextResponse

from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import MANIFEST
from ico3d.bundle.people.voice import VOICE
from ico3d.bundle.persona import Persona
from ico3d.chat.serving.page_files import ASK_AGAIN, FOR_EVER, Content, preferred
from ico3d.errors import BundleError

TYPES = {
    ".json": "application/json",
    ".png": "image/png",
    ".txt": "text/plain; charset=utf-8",
}
GZIP = "gzip"
WORTHWHILE = 0.97
"""Largest share of its size that a file may keep if it is to be sent compressed."""
KEPT_BYTES = 1 << 27
"""Bytes of compressed files that are kept. What finds no room is sent as it is: were it compressed
for each who asks, a few who ask without a pause would take the whole machine."""
MAX_COMPRESSED = 1 << 24
"""Largest size in bytes of a file that is compressed."""
LEVEL = 4
"""Of compression: 9 takes up to eight times as long for one hundredth less."""
AT_ONCE = 2
"""Files that are read at a time: voices speak in the same threads."""
GONE = 499
"""Status of an answer that nobody waits for."""


class BundleFiles:
    """Answers requests for a bundle's files."""

    def __init__(self, bundle: Bundle, persona: Persona | None):
        """Serves the files of `bundle`, with `persona` in the manifest in place of its own."""
        self._bundle = bundle
        self._persona = persona
        self._being_sent: WeakValueDictionary[str, Content] = WeakValueDictionary()
        self._kept: dict[str, Content | None] = {}
        self._room = KEPT_BYTES
        self._turns = asyncio.Semaphore(AT_ONCE)

    async def serve(self, name: str, request: Request) -> Response:
        """Answers in turn; nothing is read for those who have left meanwhile."""
        async with self._turns:
            if await request.is_disconnected():
                return Response(status_code=GONE)
            return await asyncio.to_thread(self.answer, name, request)

    def answer(self, name: str, request: Request) -> Response:
        """The file `name`, or 304 if the browser has it; it reads and compresses."""
        if name not in self._bundle.names or name == VOICE:  # no page needs it: it stays here
            return PlainTextResponse(f"The bundle has no file {name[:80]!r}.\n", 404)
        entry = self._bundle.manifest.files.get(name)
        try:
            small = self._compressed(name) if _takes_gzip(request) else None
            headers = _headers(request, entry.sha256 if entry else None, small is not None)
            if "ETag" in headers and request.headers.get("if-none-match") == headers["ETag"]:
                return Response(status_code=304, headers=headers)
            content = small or self._plain(name)
        except BundleError as error:
            return PlainTextResponse(f"{error}\n", 500)
        media_type = TYPES.get(Path(name).suffix, "application/octet-stream")
        return content.answer(200, media_type, headers)

    def _plain(self, name: str) -> Content:
        """A file as it is; who asks while others are being sent it shares their bytes."""
        content = self._being_sent.get(name) or Content(self._content(name))
        return self._being_sent.setdefault(name, content)

    def _content(self, name: str) -> bytes:
        """A file as the page gets it: what a persona knows and how it behaves is not sent."""
        if name != MANIFEST:
            return self._bundle.read(name)
        persona = self._persona or self._bundle.manifest.persona
        shown = Persona(
            persona.name,
            persona.greeting,
            languages=persona.languages,
            suggestions=persona.proposed,
        )
        return replace(self._bundle.manifest, persona=shown).to_json()

    def _compressed(self, name: str) -> Content | None:
        """A file's content by gzip; None where that saves little, or finds no room."""
        if name not in self._kept:
            self._kept[name] = self._compress(self._content(name))
        return self._kept[name]

    def _compress(self, data: bytes) -> Content | None:
        if len(data) > min(MAX_COMPRESSED, self._room):
            return None
        small = gzip.compress(data, LEVEL, mtime=0)
        if len(small) > WORTHWHILE * len(data):
            return None
        self._room -= len(small)
        return Content(small)


def _takes_gzip(request: Request) -> bool:
    return preferred(request.headers.get("accept-encoding", ""), [GZIP]) == GZIP


def _headers(request: Request, sha256: str | None, compressed: bool) -> dict[str, str]:
    """Caching and coding of an answer.

    Args:
        request: What is answered.
        sha256: The file's hash; None for the manifest, which has none.
        compressed: Whether the file is sent by gzip.
    """
    named = sha256 is not None and request.query_params.get("sha256") == sha256
    headers = {"Cache-Control": FOR_EVER if named else ASK_AGAIN, "Vary": "Accept-Encoding"}
    if named and "token" in request.query_params:  # shared caches would not look at the token
        headers["Cache-Control"] = FOR_EVER.replace("public", "private")
    if sha256 is not None:
        headers["ETag"] = f'"{sha256}.gz"' if compressed else f'"{sha256}"'
    if compressed:
        headers["Content-Encoding"] = GZIP
    return headers
