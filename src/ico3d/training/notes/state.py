"""The notes of a run: by which command it goes on, how many steps it has, why it failed."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from ico3d.common.files import read_object, resolved, write_atomic
from ico3d.errors import Ico3dError, StorageError
from ico3d.training.log import is_step

STATE = "state.json"


@dataclass(frozen=True)
class RunState:
    """What a run notes of itself.

    Attributes:
        command: Words of the command that began it, or went on with it last; none if a program did.
        folder: Folder in which that command was given.
        path: The run's own folder at that time; people move and copy runs.
        steps: Number of its optimisation steps; None while that is not known.
        failed: The sentence with which it ended; None if it did not fail.
        done: Whether all is made; trainings have `finished.json` for that.
    """

    command: tuple[str, ...] = ()
    folder: str = ""
    path: str = ""
    steps: int | None = None
    failed: str | None = None
    done: bool = False


@dataclass(frozen=True)
class _Command:
    """A command that is being carried out, and the runs in which it is at work."""

    words: tuple[str, ...]
    runs: list[Path] = field(default_factory=list)


_COMMAND: ContextVar[_Command | None] = ContextVar("command", default=None)


@contextmanager
def carried_out(words: tuple[str, ...]) -> Iterator[None]:
    """While a command is carried out, runs note it; if it fails, unfinished ones note why."""
    command = _Command(words)
    token = _COMMAND.set(command)
    try:
        yield
    except Exception as error:
        said = str(error) if isinstance(error, Ico3dError) else f"{type(error).__name__}: {error}"
        for folder in command.runs:
            with suppress(StorageError, OSError):  # the disk may be what failed
                note(folder, failed=said)
        raise
    finally:
        _COMMAND.reset(token)


def begun(folder: Path) -> None:
    """Notes that a run is worked at, by which command."""
    command = _COMMAND.get()
    told: dict[str, Any] = {"failed": None, "done": False}
    if command is not None:
        command.runs.append(folder)
        told |= {"command": command.words, "folder": os.getcwd(), "path": str(resolved(folder))}
    note(folder, **told)


def ended(folder: Path) -> None:
    """Whatever fails from now on does not concern this run."""
    command = _COMMAND.get()
    if command is not None:
        command.runs[:] = [run for run in command.runs if run != folder]


def note(folder: Path, /, **changes: Any) -> None:
    """Changes the notes of a run, where they differ.

    Args:
        folder: The run's folder.
        changes: New values of fields of `RunState`.

    Raises:
        StorageError: If the disk is full.
    """
    before = read_state(folder)
    now = replace(before, **changes)
    if now != before:
        write_atomic(folder / STATE, json.dumps(asdict(now), indent=1).encode())


def read_state(folder: Path) -> RunState:
    """The notes of a run; empty ones where there are none that can be read."""
    try:
        told = read_object(folder / STATE)
        return RunState(
            tuple(map(str, told["command"])),
            str(told["folder"]),
            str(told["path"]),
            told["steps"] if is_step(told["steps"]) else None,
            None if told["failed"] is None else str(told["failed"]),
            bool(told["done"]),
        )
    except (ValueError, LookupError, TypeError, OverflowError):
        return RunState()
