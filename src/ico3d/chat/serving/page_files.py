"""The built page's files: the smallest form that a browser takes, kept as long as it stays right.

Vite writes each text file also as `NAME.br` and `NAME.gz` (`viewer/compression.ts`). Names under
`assets/` hold a hash of their content, so that what a browser has of them never grows old;
`index.html` names them and is asked for anew each time. A page built without compressed files is
served as it is.
"""

import hashlib
import os
import re
from collections.abc import Collection
from functools import lru_cache
from mimetypes import guess_type
from pathlib import Path

from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.staticfiles import NotModifiedResponse, StaticFiles
from starlette.types import Scope

ENCODINGS = {"br": ".br", "gzip": ".gz"}
"""Content codings and the suffixes of files that are in them, the smallest first."""
HASHED = "assets"
"""The folder whose file names hold hashes."""
FOR_EVER = "public, max-age=31536000, immutable"
ASK_AGAIN = "no-cache"
TYPES = {".css": "text/css", ".html": "text/html", ".js": "text/javascript"}
"""What a machine's own list of types must not change: browsers refuse scripts of another type."""
WEIGHT = re.compile(r"0(\.\d{0,3})?|1(\.0{0,3})?")


class PageFiles(StaticFiles):
    """Serves a folder that Vite built."""

    def __init__(self, folder: Path):
        """Serves the files of `folder`; `index.html` stands for the folder itself."""
        super().__init__(directory=folder, html=True)
        self._hashed = folder.resolve() / HASHED

    def lookup_path(self, path: str) -> tuple[str, os.stat_result | None]:
        """Finds a file; compressed ones are no files of their own."""
        if path.endswith(tuple(ENCODINGS.values())):
            return "", None
        return super().lookup_path(path)

    def file_response(
        self,
        full_path: str | os.PathLike[str],
        stat_result: os.stat_result,
        scope: Scope,
        status_code: int = 200,
    ) -> Response:
        """The file in the best form that the request takes; 304 where the browser has that."""
        plain, request = Path(full_path), Headers(scope=scope)
        forms = {name: Path(f"{plain}{suffix}") for name, suffix in ENCODINGS.items()}
        forms = {name: file for name, file in forms.items() if file.is_file()}
        chosen = preferred(request.get("accept-encoding", ""), forms)
        file = forms.get(chosen, plain)
        stat = file.stat() if chosen else stat_result
        media_type = TYPES.get(plain.suffix) or guess_type(plain)[0]
        response = FileResponse(file, status_code, media_type=media_type, stat_result=stat)
        # of the content: all files of a wheel are of the same second, and often of the same size
        response.headers["ETag"] = _tag(file, stat.st_mtime_ns, stat.st_size)
        response.headers["Cache-Control"] = FOR_EVER if self._hashed in plain.parents else ASK_AGAIN
        if forms:
            response.headers["Vary"] = "Accept-Encoding"
        if chosen:
            response.headers["Content-Encoding"] = chosen
        if self.is_not_modified(response.headers, request):
            return NotModifiedResponse(response.headers)
        return response


def preferred(accepted: str, offered: Collection[str]) -> str:
    """The content coding to answer in; empty for none.

    Args:
        accepted: An Accept-Encoding header: codings with weights from 0 (never) to 1.
        offered: What there is, the best first.
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
def _tag(file: Path, changed: int, size: int) -> str:
    """The ETag of a file as it was `changed` (ns), of `size` bytes: a hash of what is in it."""
    return f'"{hashlib.sha256(file.read_bytes()).hexdigest()[:32]}"'
