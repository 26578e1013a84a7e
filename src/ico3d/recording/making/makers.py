"""Starts and stops the processes that make avatars."""

import contextlib
import subprocess
import threading
from pathlib import Path
from typing import cast

from ico3d.avatar.embodying.look import UNCHANGED, Look
from ico3d.creating.settings import QUALITIES, QualityName
from ico3d.errors import StorageError
from ico3d.recording.keeping.people import People
from ico3d.recording.keeping.person import Person
from ico3d.recording.keeping.plan import CONSENT
from ico3d.recording.making.beside import start, stop
from ico3d.recording.making.places import Places
from ico3d.recording.making.progress import Progress, begun, read_progress, write_progress
from ico3d.recording.refusals import Refused

WORKER = "ico3d.recording.making.worker"
LOG = "log.txt"


class Makers:
    """The processes that make avatars, one at a time: there is but one machine."""

    def __init__(
        self,
        people: People,
        body: Path | None = None,
        look: Look = UNCHANGED,
        worker: str = WORKER,
    ):
        """Makes avatars of people by processes of their own.

        Args:
            people: Whose.
            body: A whole person whose body they get; None makes heads alone.
            look: Build and outfit of that body.
            worker: The module of the processes.
        """
        self._people, self._worker = people, worker
        self._on = [] if body is None else [str(body), look.build, look.outfit]
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._lock = threading.Lock()

    def begin(self, person: Person, quality: str) -> None:
        """Begins to make an avatar, or goes on with it.

        Raises:
            Refused: If the consent was not spoken, nothing is recorded, the quality is unknown, or
                an avatar is being made.
        """
        if quality not in QUALITIES:
            raise Refused("quality", f"there is no quality {quality[:20]!r}.")
        person.check_spoken()
        if not {part.id for part in person.parts() if part.report is not None} - {CONSENT}:
            said = "nothing is recorded: record some parts, or choose a video."
            raise Refused("nothing", said, 409)
        with self._lock:
            busy = [name for name, one in self._running.items() if one.poll() is None]
            if busy:
                raise Refused("busy", f"an avatar of {busy[0]} is being made: wait for it.", 409)
            folder = Places(person.folder).folder
            folder.mkdir(exist_ok=True)
            write_progress(folder, begun(folder, cast(QualityName, quality)))
            with (folder / LOG).open("ab") as log:
                words = [str(person.folder), quality, *self._on]
                self._running[person.name] = start(self._worker, words, log)

    def progress(self, person: Person) -> Progress | None:
        """How far somebody's avatar is; None where none was begun."""
        folder = Places(person.folder).folder
        with self._lock:
            process = self._running.get(person.name)
            ended = None if process is None else process.poll()
        found = read_progress(folder)
        if found is None or found.state != "running" or (process is not None and ended is None):
            return found
        why = "the making has ended unexpectedly: begin again, it goes on where it was."
        failed = Progress("failed", found.quality, found.step, found.share, error=why)
        with contextlib.suppress(StorageError):  # that may be why
            write_progress(folder, failed)
        return failed

    def stop(self, person: Person) -> None:
        """Stops the making of an avatar, if one is being made; it can go on later."""
        with self._lock:
            process = self._running.pop(person.name, None)
            if process is not None:
                stop(process)
        folder = Places(person.folder).folder
        found = read_progress(folder)
        if found is not None and found.state == "running":
            write_progress(folder, Progress("stopped", found.quality, found.step, found.share))

    def go_on(self) -> None:
        """Goes on with what was being made when the server ended."""
        for name in self._people.names():
            person = self._people.person(name)
            found = read_progress(Places(person.folder).folder)
            if found is not None and found.state == "running":
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
