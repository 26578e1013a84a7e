"""Serves the files of the built page, compressed and with caching.

Vite writes each text file also as `NAME.br` and `NAME.gz` (`viewer/compression.ts`). Names in
`assets/` contain a hash of the content, so that browsers may keep these files for ever;
`index.html`, which refers to them, is requested again each time. A page that was built without
compressed files is served uncompressed.
"""

import asyncio
import hashlib
import os
import re
from collections.abc import AsyncIterator, Collection, Mapping
from functools import lru_cache
from mimetypes import guess_type
from pathlib import Path

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.staticfiles import NotModifiedResponse, StaticFiles
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocketClose

from ico3d.common.files import resolved

ENCODINGS = {"br": ".br", "gzip": ".gz"}
"""Content codings and the suffixes of compressed files, the smallest first."""
HASHED = "assets"
"""Folder in which file names contain hashes."""
FOR_EVER = "public, max-age=31536000, immutable"
ASK_AGAIN = "no-cache"
TYPES = {".css": "text/css", ".html": "text/html", ".js": "text/javascript"}
"""Content types that the machine's own table must not change: browsers check those of scripts."""
LONGEST, DEEPEST = 512, 8
"""Letters and folders of a path that is looked for: the system looks at every folder of it."""
AT_ONCE = 2
"""Files that are looked for at a time, each in a thread: dozens of them would keep the loop out."""
PIECE = 1 << 16
"""Bytes that are handed to a connection at once, of which a slow reader leaves many waiting."""
WEIGHT = re.compile(r"0(\.\d{0,3})?|1(\.0{0,3})?")


class Content:
    """The bytes of an answer, shared by all who are being sent them."""

    def __init__(self, data: bytes):
        """Wraps the bytes of a whole file."""
        self.data = data

    def answer(
        self, status: int, media_type: str | None, headers: Mapping[str, str] | None = None
    ) -> Response:
        """An answer of these bytes, which wait for their reader."""
        length = {"Content-Length": str(len(self.data))}
        return StreamingResponse(self._pieces(), status, {**(headers or {}), **length}, media_type)

    async def _pieces(self) -> AsyncIterator[bytes]:
        """Yields the bytes in order."""
        for at in range(0, len(self.data), PIECE):
            yield self.data[at : at + PIECE]


class PageFiles(StaticFiles):
    """Serves a folder that Vite has built."""

    def __init__(self, folder: Path):
        """Serves the files of `folder`; / gives `index.html`, /NAME also `NAME.html`."""
        super().__init__(directory=folder, html=True)
        self._hashed = resolved(folder) / HASHED
        self._turns = asyncio.Semaphore(AT_ONCE)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answers in turn; nothing is looked for on behalf of those who have left meanwhile."""
        if scope["type"] == "websocket":  # to which no file is an answer
            return await WebSocketClose()(scope, receive, send)
        async with self._turns:
            if await Request(scope, receive).is_disconnected():
                return
            response = await self.get_response(self.get_path(scope), scope)
        await response(scope, receive, send)

    def get_path(self, scope: Scope) -> str:
        """The path of a request within the folder; none that no page's file has is looked at."""
        path = scope["path"]
        if len(path) > LONGEST or path.count("/") > DEEPEST:
            raise HTTPException(404)
        return super().get_path(scope)

    def lookup_path(self, path: str) -> tuple[str, os.stat_result | None]:
        """Finds a file; compressed variants cannot be requested by name."""
        if path.endswith(tuple(ENCODINGS.values())):
            return "", None
        full, stat = super().lookup_path(path)
        if stat is None and not Path(path).suffix:
            return super().lookup_path(f"{path}.html")
        return full, stat

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        """The file in the best coding that the request accepts; 304 if the browser has it."""
        plain, request = Path(full_path), Headers(scope=scope)
        forms = {name: Path(f"{plain}{suffix}") for name, suffix in ENCODINGS.items()}
        forms = {name: file for name, file in forms.items() if os.path.isfile(file)}
        chosen = preferred(request.get("accept-encoding", ""), forms)
        file = forms.get(chosen, plain)
        stat = file.stat() if chosen else stat_result
        media_type = TYPES.get(plain.suffix) or guess_type(plain)[0]
        content, tag = _content(file, stat.st_mtime_ns, stat.st_size)
        response = content.answer(status_code, media_type)
        response.headers["ETag"] = tag
        response.headers["Cache-Control"] = FOR_EVER if self._hashed in plain.parents else ASK_AGAIN
        if forms:
            response.headers["Vary"] = "Accept-Encoding"
        if chosen:
            response.headers["Content-Encoding"] = chosen
        if self.is_not_modified(response.headers, request):
            return NotModifiedResponse(response.headers)
        return response


def preferred(accepted: str, offered: Collection[str]) -> str:
    """The best content coding for an answer; empty for none.

    Args:
        accepted: An Accept-Encoding header: codings with weights from 0 (refused) to 1.
        offered: Available codings, the best first.
    """
    weights = dict(_coding(part) for part in accepted.split(","))
    weight = {name: weights.get(name, weights.get("*", 0.0)) for name in offered}
    best = max(offered, key=weight.__getitem__, default="")
    return best if weight.get(best, 0.0) > 0 else ""


def _coding(part: str) -> tuple[str, float]:
    """Name and weight of one coding; what makes no sense has no weight."""
    name, _, parameters = part.partition(";")
    key, _, value = parameters.partition("=")
    weight = 1.0
    if parameters.strip():
        digits = value.strip() if key.strip().lower() == "q" else ""
        weight = float(digits) if WEIGHT.fullmatch(digits) else 0.0
    return name.strip().lower(), weight


@lru_cache(maxsize=256)
def _content(file: Path, changed: int, size: int) -> tuple[Content, str]:
    """A file as it was `changed` (ns), of `size` bytes, and its ETag.

    The ETag is of the content: all files of a wheel are of the same second, and often as long.
    """
    data = file.read_bytes()
    return Content(data), f'"{hashlib.sha256(data).hexdigest()[:32]}"'
