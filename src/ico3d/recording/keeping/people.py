"""The folder of all recordings: whose there are, and how one begins."""

import contextlib
import fcntl
import json
import logging
import os
import secrets
import shutil
import stat
import threading
import time
import unicodedata
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from datetime import date
from functools import partial
from pathlib import Path
from typing import IO

from ico3d.avatar.forgetting.removal import GONE, remove
from ico3d.bundle.people.provenance import Provenance, provenance_to_json
from ico3d.common.files import first_entries, own_file, write_atomic
from ico3d.common.people.spelling import spelled
from ico3d.creating.settings import OWN_USE
from ico3d.errors import SettingsError
from ico3d.recording.keeping.person import (
    CONSENT_FILE,
    MAKING,
    PARTS,
    TICKED,
    VOICE_CONSENT,
    Person,
)
from ico3d.recording.keeping.plan import scripts
from ico3d.recording.refusals import Refused, bad_name, full_disk

log = logging.getLogger(__name__)

LONGEST_NAME = 40
"""Letters of the name of a person, and so of a folder and a file."""
MOST, MOST_ENTRIES = 100, 1000
"""Number of people whose recordings one folder holds, and of what is looked at there."""
PATIENCE, LAST = 1.0, 5.0
"""Seconds that somebody waits for a removal, and that the end of the server waits for all."""
LOCK = ".studio.lock"
"""File of the folder that keeps it to one server."""
SPARE = 200_000_000
"""Bytes that stay free on the disk."""


class People:
    """What was recorded of people, a folder for each."""

    def __init__(self, folder: Path):
        """Keeps them below `folder`, which is made where it is missing."""
        self.folder, self._turn, self._listed = folder, threading.Lock(), threading.Lock()
        self._acts: list[threading.Thread] = []  # that go on beside
        self._counting, self._coming = threading.Lock(), 0  # bytes that are being written
        folder.mkdir(parents=True, exist_ok=True)

    def names(self) -> list[str]:
        """Whose recordings there are, sorted."""
        found = [entry.name for entry in first_entries(self.folder, MOST_ENTRIES)]
        return sorted(name for name in found if is_name(name) and self._is_here(name))

    def person(self, name: str) -> Person:
        """Somebody who agreed.

        Raises:
            Refused: If there is nobody of this name.
        """
        kept = checked_name(name)  # a folder that was brought may spell it otherwise
        here = [one for one in (kept, name) if is_name(one) and self._is_here(one)]
        if not here:
            raise Refused("unknown", f"nothing is recorded of {name[:40]}.", 404)
        return Person(self.folder / here[0])

    def _is_here(self, name: str) -> bool:
        """Whether somebody agreed, and their files lie in this folder, not behind a link."""
        folder = self.folder / name
        places = folder, folder / CONSENT_FILE, folder / PARTS, folder / MAKING
        return not any(map(os.path.islink, places)) and os.path.isfile(folder / CONSENT_FILE)

    def begin(
        self, name: str, language: str, agreed: bool, today: date, voice: bool = False
    ) -> Person:
        """Begins a recording with what the person agreed to.

        Args:
            name: The person's name.
            language: Language in which they agree and read.
            agreed: Whether they ticked the sentence.
            today: The day.
            voice: Whether they ticked that their voice may be cloned, too.

        Raises:
            Refused: If the name is none or taken, if they did not agree, or there is no room.
        """
        name = checked_name(name)
        script = scripts().get(language)
        if script is None:
            raise Refused("language", f"there are no texts in the language {language[:10]!r}.")
        if not agreed:
            raise Refused("consent", "nothing is recorded of anybody who did not agree.", 403)
        if len(self.names()) >= MOST:
            raise Refused("many", "there are recordings of 100 people: delete some of them.", 409)
        how = f"agreed on {today.isoformat()}{TICKED}"
        said = f"{how}“{script.consent.format(name=name)}”"
        about = Provenance("portrait", (), said, OWN_USE, name, name)
        stated = provenance_to_json(about) | {"language": language}
        if voice:
            stated[VOICE_CONSENT] = f"{how}“{script.voice}”"
        text = json.dumps(stated, indent=1, ensure_ascii=False)
        folder = self.folder / name
        with self.room_for(len(text)):
            try:
                folder.mkdir()
            except FileExistsError as error:  # also if somebody else begins just now
                raise Refused("taken", f"there are recordings of {name} already.", 409) from error
            try:
                write_atomic(folder / CONSENT_FILE, text.encode())
            except BaseException:
                folder.rmdir()  # or nobody could begin again
                raise
        return Person(folder)

    @contextlib.contextmanager
    def room_for(self, size: int) -> Iterator[None]:
        """While something is written: refuses it where the disk is nearly full.

        Args:
            size: Bytes that are written meanwhile.

        Raises:
            Refused: If too few would stay free, together with what others are writing.
        """
        with self._counting:
            if shutil.disk_usage(self.folder).free - self._coming - size < SPARE:
                raise full_disk()
            self._coming += size
        try:
            yield
        finally:
            with self._counting:
                self._coming -= size

    def delete(self, name: str) -> None:
        """Removes everything of a person: consent, recordings, what was made of them.

        Raises:
            Refused: If there is nobody of this name.
            SettingsError: If something cannot be removed; the sentence names it.
        """
        self.remove(self.set_aside(self.person(name).folder))

    def set_aside(self, path: Path) -> list[Path]:
        """Hides a file or folder of somebody, however large, at once: nobody writes there again.

        Returns:
            What `remove` is to be given, or `clear` removes at the next start; nothing where there
            is none.

        Raises:
            SettingsError: If it cannot be renamed.
        """
        name = path.relative_to(self.folder).parts[0]
        gone = self.folder / f".{name}.{secrets.token_hex(8)}.gone"
        try:
            if os.path.isdir(path) and not os.path.islink(path):
                with contextlib.suppress(OSError):  # only who may write there may move it
                    path.chmod(stat.S_IRWXU)
            path.rename(gone)
        except FileNotFoundError:
            return []
        except OSError as error:
            raise SettingsError(f"{path} cannot be removed ({error.strerror}).") from error
        return [gone]

    def remove(self, gone: list[Path]) -> None:
        """Removes what was set aside, of one person after another.

        Raises:
            SettingsError: If something cannot be removed, and that is known within `PATIENCE`;
                nobody waits for another one's removal.
        """
        if gone:
            self.in_turn(partial(remove, gone))

    def in_turn(self, act: Callable[[], None]) -> None:
        """Does what takes as long as somebody's folder has files, one such thing after another.

        It is waited for, but not for long, and not at all while another one goes on: then it goes
        on by itself, and the log says if it fails. Requests have few threads.

        Args:
            act: What is done; its error is raised as long as it is waited for.
        """
        end: Future[None] = Future()
        patience = 0.0 if self._turn.locked() else PATIENCE

        def run() -> None:
            try:
                with self._turn:
                    act()
                end.set_result(None)
            except Exception as error:  # whatever a stranger's folder does
                log.warning("What somebody wanted removed: %s", error)
                end.set_exception(error)

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        with self._listed:
            self._acts = [one for one in self._acts if one.is_alive()] + [thread]
        with contextlib.suppress(TimeoutError):
            end.result(patience)

    def close(self) -> None:
        """Waits a little for removals; `clear` ends at the next start those that take longer."""
        end = time.monotonic() + LAST
        for thread in self._acts:
            thread.join(max(0.0, end - time.monotonic()))
        if any(thread.is_alive() for thread in self._acts):
            log.warning("What somebody wanted removed is not all gone: the next start goes on.")

    def clear(self) -> None:
        """Removes what is left of removals that were killed; what cannot be removed is logged."""
        names = (entry.name for entry in first_entries(self.folder, MOST_ENTRIES))
        with contextlib.suppress(SettingsError):
            self.remove([self.folder / name for name in names if GONE.fullmatch(name)])


def held(folder: Path) -> IO[bytes]:
    """Keeps a folder of recordings to one server, as long as what is returned is open.

    Another one would go on with the same makings, and write what the first one deletes. The lock is
    a file that nobody else may read: whoever can open a folder could hold its own. Where there can
    be none, on a full disk or in a stranger's folder, nothing is kept.

    Raises:
        SettingsError: If another server holds it.
    """
    try:
        lock = own_file(folder / LOCK)
        os.fchmod(lock.fileno(), 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise SettingsError(
            f"{folder} is served by another ico3d studio: use its page, or end it."
        ) from error
    except OSError as error:
        log.warning("Another studio may serve %s, too: %s", folder, error)
        return open(os.devnull, "wb")
    return lock


def is_name(text: str) -> bool:
    """Whether a text may be a name: letters with their marks, digits, spaces and hyphens."""
    others = text[1:]
    marked = all(c.isalnum() or c in "_ -" or unicodedata.category(c)[0] == "M" for c in others)
    return text[:1].isalpha() and len(text) <= LONGEST_NAME and marked


def checked_name(name: str) -> str:
    """A name as it is kept.

    Raises:
        Refused: If it is none.
    """
    name = spelled("NFC", name).strip()
    if not is_name(name):
        raise bad_name()
    return name
