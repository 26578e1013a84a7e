"""What is recorded of one person: parts that grow while they are recorded, and the kept ones."""

import contextlib
import fnmatch
import json
import os
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ico3d.common.files import first_entries, write_atomic
from ico3d.recording.keeping.containers import HEAD, suffix_of
from ico3d.recording.keeping.noted import noted
from ico3d.recording.keeping.plan import ALL_IDS, CONSENT, UPLOAD, scripts
from ico3d.recording.refusals import Refused, no_video, nothing_arrived

CONSENT_FILE = "consent.json"
PARTS, MAKING = "parts", "making"
"""Folders of what was recorded, and of what is made of it."""
UNFINISHED = ".part"
MOST_BYTES, MOST_UPLOADED = 256 << 20, 2 << 30
"""Largest size of a recorded part, and of a video that is brought."""
TICKED, TICKED_AND_SPOKEN = ", ticked: ", ", ticked and spoken: "
"""How a person agreed, as their consent says it."""
VOICE_CONSENT = "voice_consent"
"""Entry of the consent of those who agreed that their voice is cloned, too."""
MOST_FILES = 1000
"""Files of the parts that are looked at; a recording has some dozens, and each page asks for them
again and again."""
UNSEEN: dict[str, Any] = {"seconds": 0.0, "turn": None, "advice": []}
"""What is said of a part of which nobody knows what was found in it."""
MOST_TAKES = 4
"""Unfinished takes of one part that are kept; older ones make room."""


@dataclass(frozen=True)
class Part:
    """A part as it lies on the disk.

    Attributes:
        id: Its name.
        file: The recording.
        take: Name of the take, where its recording broke off and it was not kept yet; else empty.
        report: What was found in it; None where it was not kept yet.
    """

    id: str
    file: Path
    take: str
    report: dict[str, Any] | None


class Person:
    """The files of one person."""

    def __init__(self, folder: Path):
        """Takes the person's folder, which holds their consent."""
        self.folder = folder
        self._parts = folder / PARTS

    @property
    def name(self) -> str:
        """The person's name."""
        return self.folder.name

    def consent(self) -> dict[str, Any]:
        """What the person agreed to, as bundles state it, with the language of the texts.

        Raises:
            Refused: If the file is damaged.
        """
        try:
            about = noted(self.folder / CONSENT_FILE)
            said = [about.get(entry, "") for entry in ("language", "consent", VOICE_CONSENT)]
            if all(isinstance(one, str) for one in said) and said[0] in scripts():
                return about
        except (OSError, ValueError, AttributeError):
            pass
        raise Refused("unknown", f"the consent of {self.name} cannot be read.", 404)

    def check_spoken(self) -> None:
        """Refuses to go on before the person said aloud that they agree.

        Raises:
            Refused: If that part was not recorded.
        """
        if self._kept(CONSENT) is None:
            raise Refused("unspoken", "say first that you agree: record that part.", 409)

    def parts(self) -> Iterator[Part]:
        """All parts, kept ones and those whose recording broke off."""
        yield from filter(None, map(self.part, sorted(ALL_IDS)))

    def part(self, id: str) -> Part | None:
        """One part; None where nothing of it was recorded."""
        checked_id(id)
        return self._found(id) or self._found(id)  # a listing may miss what is renamed meanwhile

    def append(self, id: str, take: str, offset: int, data: bytes) -> int:
        """Adds bytes to a take; those that it has already are taken as repeated.

        Args:
            id: The part.
            take: Name of the take: letters and digits, chosen by the page.
            offset: Number of bytes before these.
            data: The bytes.

        Returns:
            Size of the take in bytes.

        Raises:
            Refused: If they do not follow what is there, are too many, or no video begins so.
            OSError: If they cannot be written.
        """
        file = self._take(id, take)
        size = file.stat().st_size if os.path.lexists(file) else 0
        if offset + len(data) > (MOST_UPLOADED if id == UPLOAD else MOST_BYTES):
            raise Refused("large", "this is longer than is recorded: stop, and begin anew.", 413)
        if offset + len(data) <= size:
            return size
        if offset != size:
            raise Refused("gap", f"{size} bytes of this part are there: go on from these.", 409)
        if offset == 0:
            if not suffix_of(data[:HEAD]):
                raise no_video()
            self._make_room(id)
        self._parts.mkdir(exist_ok=True)
        with file.open("ab") as stream:
            try:
                stream.write(data)
                stream.flush()
            except OSError:
                stream.truncate(size)  # what follows is to begin where the page thinks
                raise
        return size + len(data)

    def unfinished(self, id: str, take: str) -> Path:
        """The file of a take that is not kept yet.

        Raises:
            Refused: If there is none.
        """
        file = self._take(id, take)
        if not os.path.isfile(file):
            raise nothing_arrived()
        return file

    def keep(self, id: str, take: str, report: dict[str, Any]) -> None:
        """Lets a take be the part, in the place of an earlier one."""
        file, before = self.unfinished(id, take), self._kept(id)
        with file.open("rb") as stream:
            suffix = suffix_of(stream.read(HEAD))
        kept = self._parts / f"{id}{suffix}"
        self._parts.joinpath(f"{id}.json").unlink(missing_ok=True)  # what was said of the other one
        file.replace(kept)
        write_atomic(self._parts / f"{id}.json", json.dumps(report, indent=1).encode())
        if before is not None and before != kept:
            before.unlink()
        for other in self._takes(id):
            other.unlink()
        if id == CONSENT:
            self._state(TICKED, TICKED_AND_SPOKEN)

    def discard(self, id: str, take: str) -> None:
        """Removes a take of which nothing can be made."""
        self._take(id, take).unlink(missing_ok=True)

    def remove(self, id: str) -> None:
        """Removes a part, its takes and what was found in it."""
        for file in self._parts.glob(f"{checked_id(id)}.*"):
            if os.path.islink(file) or not os.path.isdir(file):
                file.unlink()
        if id == CONSENT:
            self._state(TICKED_AND_SPOKEN, TICKED)

    def _state(self, before: str, now: str) -> None:
        """Says of the consent how it was given."""
        about = self.consent()
        for entry in {"consent", VOICE_CONSENT} & about.keys():
            about[entry] = about[entry].replace(before, now)
        text = json.dumps(about, indent=1, ensure_ascii=False)
        write_atomic(self.folder / CONSENT_FILE, text.encode())

    def _take(self, id: str, take: str) -> Path:
        if not (take.isascii() and take.isalnum() and len(take) <= 32):
            raise Refused("part", "a take has a name of letters and digits.", 404)
        file = self._parts / f"{checked_id(id)}.{take}{UNFINISHED}"
        if os.path.lexists(file) and not stat.S_ISREG(file.lstat().st_mode):
            raise Refused("part", "what is there is no take.", 404)
        return file

    def _found(self, id: str) -> Part | None:
        """A part as one listing shows it, the kept one before takes of a new one."""
        files = list(self._files(f"{id}.*"))
        kept, takes = _kept_of(files), with_stat(f for f in files if f.suffix == UNFINISHED)
        if kept is not None:
            return Part(id, kept, "", self._report(id))
        if not takes:
            return None
        largest, _ = max(takes, key=lambda take: take[1].st_size)
        return Part(id, largest, largest.name.split(".")[1], None)

    def _takes(self, id: str) -> list[Path]:
        """Unfinished takes of a part, the oldest first."""
        takes = with_stat(self._files(f"{id}.*{UNFINISHED}"))
        return [file for file, _ in sorted(takes, key=lambda take: take[1].st_mtime)]

    def _kept(self, id: str) -> Path | None:
        return _kept_of(self._files(f"{id}.*"))

    def _files(self, pattern: str) -> Iterator[Path]:
        """Files of the parts; what a link leads to may be anything of this machine."""
        for entry in first_entries(self._parts, MOST_FILES):
            fits = fnmatch.fnmatchcase(entry.name, pattern)
            if fits and entry.is_file(follow_symlinks=False):
                yield self._parts / entry.name

    def _make_room(self, id: str) -> None:
        for old in self._takes(id)[: -(MOST_TAKES - 1)]:
            old.unlink()

    def _report(self, id: str) -> dict[str, Any]:
        try:
            found = noted(self._parts / f"{id}.json")
            return {name: found[name] for name in UNSEEN}
        except (OSError, ValueError, TypeError, KeyError):
            return dict(UNSEEN)


def checked_id(id: str) -> str:
    """The name of a part.

    Raises:
        Refused: If there is no such part.
    """
    if id not in ALL_IDS:
        raise Refused("part", "there is no such part of a recording.", 404)
    return id


def _kept_of(files: Iterable[Path]) -> Path | None:
    """The recording among the files of a part."""
    return next((file for file in files if file.suffix not in (UNFINISHED, ".json")), None)


def with_stat(files: Iterable[Path]) -> list[tuple[Path, os.stat_result]]:
    """Files with what the system says of them, but those that are gone meanwhile."""
    found = []
    for file in files:
        with contextlib.suppress(FileNotFoundError):
            found.append((file, file.stat()))
    return found
