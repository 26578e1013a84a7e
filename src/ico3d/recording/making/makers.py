"""Starts and stops the processes that make avatars."""

import contextlib
import logging
import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

from ico3d.avatar.embodying.look import Look
from ico3d.bundle.packaged import NAME
from ico3d.common.files import remove_unfinished
from ico3d.creating.settings import QUALITIES, QualityName
from ico3d.errors import BundleError, Ico3dError, StorageError
from ico3d.failures import FAILURES
from ico3d.recording.beside import FULL_DISK, start, stop
from ico3d.recording.keeping.body_choice import HEAD_ALONE, BodyChoice, read_choice
from ico3d.recording.keeping.people import People
from ico3d.recording.keeping.person import Person, checked_id
from ico3d.recording.keeping.plan import CONSENT
from ico3d.recording.making.places import Places
from ico3d.recording.making.progress import Progress, begun, read_progress, write_progress
from ico3d.recording.making.sources import Recorded, signature
from ico3d.recording.refusals import Refused

_log = logging.getLogger(__name__)
WORKER = "ico3d.recording.making.worker"
LOG = "log.txt"
ENDS = {-signal.SIGKILL: "killed", FULL_DISK: "disk-full"}
"""Why a process has ended that could not write it down, by its exit status."""


@dataclass(frozen=True)
class Bodies:
    """The bodies that avatars may get.

    Attributes:
        body: A whole person, whose body stands in.
        default: What counts for those who chose nothing.
    """

    body: Path = Path(NAME)
    default: BodyChoice = HEAD_ALONE
    _faults: dict[Look, str] = field(default_factory=dict, init=False, compare=False)
    """What was found about a look; nothing where the body can have it."""

    @property
    def is_packaged(self) -> bool:
        """Whether the body is that of the packaged avatar."""
        return self.body == Path(NAME)

    def choice(self, person: Person) -> BodyChoice:
        """What was chosen for somebody."""
        return read_choice(person.folder, self.default)

    def check(self, choice: BodyChoice) -> None:
        """Refuses a look that the body cannot have; that of the package has all of them.

        Raises:
            BundleError: If it cannot look so; the sentence says why.
        """
        if not choice.wanted or self.is_packaged:
            return
        if choice.look not in self._faults:  # it takes a second, and who asks may ask again
            self._faults[choice.look] = self._fault(choice.look)
        if fault := self._faults[choice.look]:
            raise BundleError(fault)

    def _fault(self, look: Look) -> str:
        """Why the body cannot look so; nothing if it can."""
        from ico3d.avatar.embodying.embody import body_in
        from ico3d.bundle.format import Bundle

        try:
            body_in(Bundle.open(self.body), look)
        except BundleError as error:
            return str(error)
        return ""

    def words(self, person: Person) -> list[str]:
        """Body, build and outfit for the process that makes; none for a head alone."""
        choice = self.choice(person)
        return [str(self.body), choice.look.build, choice.look.outfit] if choice.wanted else []


PACKAGED = Bodies()


class Makers:
    """The processes that make avatars, one at a time: there is but one machine."""

    def __init__(
        self,
        people: People,
        bodies: Bodies = PACKAGED,
        worker: str = WORKER,
    ):
        """Makes avatars of people by processes of their own.

        Args:
            people: Whose.
            bodies: Which bodies they may get.
            worker: The module of the processes.
        """
        self._people, self._bodies, self._worker = people, bodies, worker
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._lock = threading.Lock()

    def begin(self, person: Person, quality: str, anew: bool = False) -> None:
        """Begins to make an avatar, or goes on with it.

        Args:
            person: Whose.
            quality: How well it is to be made.
            anew: Whether what was made so far is removed first.

        Raises:
            Refused: If the consent was not spoken, nothing is recorded, the quality is unknown, or
                an avatar is being made.
        """
        if quality not in QUALITIES:
            raise Refused("quality", f"there is no quality {quality[:20]!r}.")
        person.check_spoken()
        recorded = Recorded.of(person)
        if not recorded.sources:
            said = "nothing is recorded: record some parts, or choose a video."
            raise Refused("nothing", said, 409)
        with self._clearing() as gone:
            if busy := self._busy():
                raise Refused("busy", f"an avatar of {busy[0]} is being made: wait for it.", 409)
            folder = Places(person.folder).folder
            if anew:
                gone += self._people.set_aside(folder)
            folder.mkdir(exist_ok=True)
            of = self._made_of(person, recorded)
            write_progress(folder, begun(folder, cast(QualityName, quality), of))
            log_file = folder / LOG
            if os.path.islink(log_file) or not os.path.isfile(log_file):  # nothing of ours
                log_file.unlink(missing_ok=True)
            with log_file.open("ab") as log:
                words = [str(person.folder), quality, *of["on"]]
                self._running[person.name] = start(self._worker, words, log)

    def is_busy(self) -> bool:
        """Whether an avatar is being made."""
        with self._lock:
            return bool(self._busy())

    def _busy(self) -> list[str]:
        """Of whom an avatar is being made, for somebody who holds the lock."""
        return [name for name, one in self._running.items() if one.poll() is None]

    def progress(self, person: Person) -> Progress | None:
        """How far somebody's avatar is; None where none was begun."""
        folder = Places(person.folder).folder
        with self._lock:  # until it is written: who stops a making may go on to delete it
            process = self._running.get(person.name)
            status = None if process is None else process.poll()
            is_at_work = process is not None and status is None
            found = read_progress(folder)
            if found is None or found.state != "running" or is_at_work:
                return found
            code = ENDS.get(status or 0, "ended")
            failed = replace(found, state="failed", left=None, error=FAILURES[code], code=code)
            with contextlib.suppress(StorageError):  # that may be why
                write_progress(folder, failed)
            return failed

    def stop(self, person: Person) -> None:
        """Stops the making of an avatar, if one is being made; it can go on later."""
        with self._lock:
            self._stop(person)

    def _stop(self, person: Person) -> None:
        """Stops the making of an avatar for somebody who holds the lock."""
        process = self._running.pop(person.name, None)
        if process is not None:
            stop(process)
        folder = Places(person.folder).folder
        found = read_progress(folder)
        if found is not None and found.state == "running":
            with contextlib.suppress(StorageError):  # what is stopped may be deleted, to make room
                write_progress(folder, replace(found, state="stopped", left=None))

    def discard(self, person: Person) -> None:
        """Removes what was made so far; recordings and a finished avatar stay."""
        with self._clearing() as gone:
            self._stop(person)
            gone += self._people.set_aside(Places(person.folder).folder)

    def withdraw(self, person: Person, id: str) -> None:
        """Removes a part with all that was made of it on the way; a finished avatar stays.

        A making that needs it is stopped, and begins anew when somebody asks: without the consent,
        any making.

        Args:
            person: Whose.
            id: The part.

        Raises:
            Refused: If there is no such part.
        """
        places, id = Places(person.folder), checked_id(id)
        with self._clearing() as gone:
            found = read_progress(places.folder)
            if found is not None and (id == CONSENT or found.is_of(id)):
                self._stop(person)
                for made in (places.work, places.joined, places.joined_of, places.made):
                    gone += self._people.set_aside(made)
        if gone:
            self._people.in_turn(partial(remove_unfinished, places.folder))
        now = time.time()
        if person.remove(id):
            self._people.in_turn(partial(person.remove_rest, id, now))

    @contextlib.contextmanager
    def _clearing(self) -> Iterator[list[Path]]:
        """Holds the lock, and removes what is listed meanwhile when others need not wait for it."""
        gone: list[Path] = []
        try:
            with self._lock:
                yield gone
        finally:
            self._people.remove(gone)

    def changed(self, person: Person, progress: Progress, recorded: Recorded) -> list[str]:
        """What is another since a making began: `parts`, `on` (the body), both or nothing."""
        now = self._made_of(person, recorded)
        return [name for name in now if progress.made_of.get(name) != now[name]]

    def _made_of(self, person: Person, recorded: Recorded) -> dict[str, Any]:
        """What tells the recording and the body that was chosen from others."""
        return {"parts": signature(recorded.sources), "on": self._bodies.words(person)}

    def go_on(self) -> None:
        """Goes on with what was being made when the server ended."""
        for name in self._people.names():
            try:
                self._go_on(self._people.person(name))
            except (Ico3dError, OSError, ValueError) as error:  # a full disk, or strange files
                _log.warning("The avatar of %s is not gone on with: %s", name, error)

    def _go_on(self, person: Person) -> None:
        found = read_progress(Places(person.folder).folder)
        if found is None or found.state != "running":
            return
        try:
            self.begin(person, found.quality)
        except Refused:
            self.stop(person)  # another one came first: its turn is when somebody asks

    def close(self) -> None:
        """Ends all processes; what they made is gone on with at the next start."""
        with self._lock:
            for process in self._running.values():
                stop(process)
            self._running.clear()
