"""The process in which an avatar is made: FOLDER QUALITY [BODY [BUILD OUTFIT]] are its words.

It ends with the process that started it, and whoever starts it again goes on where it was.
"""

import contextlib
import json
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any, cast

from ico3d.avatar.embodying.look import UNCHANGED, Look
from ico3d.avatar.forgetting.removal import remove
from ico3d.common.files import json_of, locked_folder, write_atomic
from ico3d.common.unpacking.limits import limit_to_free_memory
from ico3d.common.unpacking.memory import ran_out
from ico3d.creating.create import create
from ico3d.creating.settings import CreateSettings, QualityName
from ico3d.errors import CaptureError, Ico3dError, printable
from ico3d.failures import FAILURES
from ico3d.recording.beside import FULL_DISK, end_with_parent
from ico3d.recording.keeping.person import VOICE_CONSENT, Person
from ico3d.recording.keeping.plan import UPLOAD
from ico3d.recording.making.joining import join
from ico3d.recording.making.places import Places
from ico3d.recording.making.progress import Reporter, begun
from ico3d.recording.making.sources import Recorded, signature


def make(
    person: Person, quality: QualityName, body: Path | None = None, look: Look = UNCHANGED
) -> Path:
    """Makes the avatar of a person, or goes on with it; the progress tells of it and of its end.

    Args:
        person: Whose it is.
        quality: How well it is to be made.
        body: A whole person whose body it gets; None makes a head alone.
        look: Build and outfit of that body.

    Returns:
        The avatar.

    Raises:
        Exception: Whatever `create` raises, and `CaptureError` if there is no recording; the
            progress says so, too.
    """
    places, about = Places(person.folder), person.consent()
    tell = Reporter(places.folder, begun(places.folder, quality))
    tell.change()
    try:
        video = _video(person, places)
        settings = CreateSettings(
            video,
            places.made,
            quality,
            consent=about["consent"],
            licence=about["licence"],
            made_by=about["made_by"],
            voice_consent=about.get(VOICE_CONSENT, ""),
            body=body,
            build=look.build,
            outfit=look.outfit,
        )
        create(settings, tell)
        write_atomic(places.avatar, lambda file: _copy(places.made, file))
    except Exception as error:
        tell.change(state="failed", **_failure(error, person.folder))
        raise
    tell.change(state="made")
    return places.avatar


def _failure(error: Exception, folder: Path) -> dict[str, Any]:
    """What the progress says of an error; one that nobody foresaw has no code."""
    if ran_out(error):
        return {"error": FAILURES["memory"], "code": "memory"}
    if not isinstance(error, Ico3dError):
        return {"error": printable(f"{type(error).__name__}: {error}")}
    told = {"code": error.code, "values": dict(error.values)}
    return {"error": _short(str(error), folder)} | told


def _short(sentence: str, folder: Path) -> str:
    """A sentence without the names of files that the person does not know."""
    return re.sub(rf"{re.escape(str(folder))}/(\S+: )?", "", sentence)


def _video(person: Person, places: Places) -> Path:
    """The video that was brought, or the parts as one; what was made of another one is cleared."""
    files = Recorded.of(person).sources
    if not files:
        raise CaptureError.of("nothing")
    now = signature(files)
    video = files[0] if files[0].stem == UPLOAD else places.joined
    if _before(places) != now or os.path.islink(video) or not os.path.isfile(video):
        remove([places.work])
        places.made.unlink(missing_ok=True)
        places.joined.unlink(missing_ok=True)
        if video == places.joined:
            join(files, video)
        write_atomic(places.joined_of, json.dumps(now).encode())
    return video


def _before(places: Places) -> list | None:
    try:
        return json_of(places.joined_of, links=False)
    except (OSError, ValueError):
        return None


def _copy(file: Path, to: Path) -> None:
    shutil.copyfile(file, to)


def main() -> int:
    """Makes an avatar; the exit status.

    It takes no more memory than is free: beyond that, it ends with a sentence, not with the server.
    """
    end_with_parent()
    limit_to_free_memory()
    folder, quality, *on = sys.argv[1:]
    body, look = (Path(on[0]), Look(*cast(list[Any], on[1:]))) if on else (None, UNCHANGED)
    locked_folder(Places(Path(folder)).folder)  # so that `ico3d forget` waits for the end
    try:
        make(Person(Path(folder)), cast(QualityName, quality), body, look)
    except Ico3dError as error:
        with contextlib.suppress(OSError):  # the log lies on the same disk
            os.write(sys.stderr.fileno(), f"ico3d: {error}\n".encode())
        if error.code == "disk-full":
            os._exit(FULL_DISK)  # an end that writes the log would fail, with a status of its own
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
