"""What is recorded of one person: parts that grow while they are recorded, and the kept ones."""

import contextlib
import json
import math
import os
import stat
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ico3d.common.files import first_entries, write_atomic
from ico3d.recording.keeping.containers import HEAD, SUFFIXES, suffix_of
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
MOST_FILES = 200
"""Entries of the folder of parts among which takes are looked for; a recording has a hundred at
most, and each page asks for them again and again."""
UNSEEN: dict[str, Any] = {"seconds": 0.0, "turn": None, "advice": []}
"""What is said of a part of which nobody knows what was found in it."""
MOST_TAKES = 4
"""Unfinished takes of one part that are kept; older ones make room."""


Take = tuple[Path, os.stat_result]


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
        takes = self._takes()  # before the kept ones: what is kept meanwhile is one of these
        found = (self._found(id, takes[id]) for id in sorted(ALL_IDS))
        yield from (part for part in found if part is not None)

    def part(self, id: str) -> Part | None:
        """One part; None where nothing of it was recorded."""
        return self._found(checked_id(id), ()) or self._found(id, self._takes()[id])

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
        for other, _ in self._takes()[id]:
            other.unlink()
        if id == CONSENT:
            self._state(TICKED, TICKED_AND_SPOKEN)

    def discard(self, id: str, take: str) -> None:
        """Removes a take of which nothing can be made."""
        self._take(id, take).unlink(missing_ok=True)

    def remove(self, id: str) -> bool:
        """Removes a part, its takes and what was found in it.

        Returns:
            Whether more files lie there than are looked at; `remove_rest` removes those of the
            part.
        """
        entries = first_entries(self._parts, MOST_FILES + 1)
        seen = [entry.name for entry in entries if entry.name.startswith(f"{checked_id(id)}.")]
        for name in {*seen, *(f"{id}{suffix}" for suffix in (*SUFFIXES, ".json"))}:
            _remove_file(self._parts / name)
        if id == CONSENT:
            self._state(TICKED_AND_SPOKEN, TICKED)
        return len(entries) > MOST_FILES

    def remove_rest(self, id: str, until: float) -> None:
        """Removes all other files of a part that have not changed since a time, however many.

        Args:
            id: The part.
            until: The time in seconds since 1970: what is recorded anew meanwhile stays.
        """
        for file in self._parts.glob(f"{checked_id(id)}.*"):
            _remove_file(file, until)

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

    def _found(self, id: str, takes: Sequence[Take]) -> Part | None:
        """A part, the kept one before takes of a new one."""
        kept = self._kept(id)
        if kept is not None:
            return Part(id, kept, "", self._report(id))
        if not takes:
            return None
        largest, _ = max(takes, key=lambda take: take[1].st_size)
        return Part(id, largest, largest.name.split(".")[1], None)

    def _kept(self, id: str) -> Path | None:
        """The recording of a part; what a link leads to may be anything of this machine."""
        files = (self._parts / f"{id}{suffix}" for suffix in SUFFIXES)
        return next((file for file in files if _is_regular(file)), None)

    def _takes(self) -> defaultdict[str, list[Take]]:
        """Unfinished takes of each part, the oldest first; others may be kept or go meanwhile."""
        found: defaultdict[str, list[Take]] = defaultdict(list)
        for entry in first_entries(self._parts, MOST_FILES):
            id, _, rest = entry.name.partition(".")
            if id not in ALL_IDS or not rest.endswith(UNFINISHED):
                continue
            with contextlib.suppress(FileNotFoundError):
                about = entry.stat(follow_symlinks=False)
                if stat.S_ISREG(about.st_mode):
                    found[id].append((self._parts / entry.name, about))
        for takes in found.values():
            takes.sort(key=lambda take: take[1].st_mtime)
        return found

    def _make_room(self, id: str) -> None:
        for old, _ in self._takes()[id][: -(MOST_TAKES - 1)]:
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


def _is_regular(file: Path) -> bool:
    try:
        return stat.S_ISREG(file.lstat().st_mode)
    except OSError:
        return False


def _remove_file(file: Path, until: float = math.inf) -> None:
    """Removes a file, unless it has changed since, is gone, or is a folder."""
    with contextlib.suppress(FileNotFoundError):
        about = file.lstat()
        if about.st_ctime <= until and not stat.S_ISDIR(about.st_mode):
            file.unlink()
