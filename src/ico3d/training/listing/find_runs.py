"""Finds runs in a folder and below it, and tells of each how far it is and how it goes on."""

import os
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Literal

from ico3d.common.files import read_object, resolved, walk
from ico3d.errors import ModelError
from ico3d.training.log import METRICS, is_step, latest_entry
from ico3d.training.notes.lock import is_locked
from ico3d.training.notes.state import STATE, RunState, read_state
from ico3d.training.run import CHECKPOINTS, FINISHED, SETTINGS, checkpoint_state, usable_step

ABOUT = {SETTINGS: SETTINGS, "about.json": "lock"}
"""Files that mark runs, and those that whoever works at them holds locked."""
KINDS = {
    "joining": "assemble",
    "variant": "head",
    "method": "body",
    "strategy": "scene",
    "video": "create",
}
"""What is made, by the first of these entries that a marking file has."""
LOST = "No other checkpoint can be used: put a copy there, or move it away to begin afresh."
PROGRAM = "ico3d"
"""The only program that a run is said to go on by."""
VERBS = tuple(
    tuple(verb.split())
    for verb in (
        "create",
        "train head",
        "train static",
        "train body",
        "assemble",
        "measure portrait",
        "measure body",
        "measure ablations",
        "measure all",
    )
)
"""What it does then: these train, and note it. Others remove, serve, or start programs."""
RAY = "--ray"
"""Option that names a cluster, whose machines may run programs here: never one of strangers."""
SERVING = "--serve"
"""Option by which what is made is served, too."""
WITHIN = 50
"""Runs of which each lies within the one before; what is deeper counts as within the last."""
State = Literal["finished", "running", "interrupted", "failed", "damaged"]


@dataclass(frozen=True)
class Run:
    """A run, with all runs of its parts.

    Attributes:
        path: Its folder.
        kind: What is made: a value of `KINDS`, or "unknown" where its settings are damaged.
        step: Optimisation steps that are done; those after the latest checkpoint count only while
            somebody trains.
        steps: Number of steps in all; None while that is not known.
        state: What became of it.
        reason: Why it failed, or what is damaged; empty if neither.
        command: The command by which it goes on, with the change to its folder where that is
            another; empty where nothing is left to do, or a program began it.
        changed: When anything was written last, as `time.time()` has it.
        size: Bytes on the disk.
    """

    path: Path
    kind: str
    step: int
    steps: int | None
    state: State
    reason: str
    command: str
    changed: float
    size: int


def find_runs(folder: Path) -> list[Run]:
    """Finds the runs in a folder and below it, but for hidden folders; nothing is changed.

    Runs within runs, such as windows of a body, are told of with the outermost.
    """
    return [_told(node) for node in _nodes(folder)]


@dataclass
class _Node:
    """A folder that is a run.

    Attributes:
        path: The folder.
        kind: As of `Run`.
        lock: The file that is locked while somebody works there.
        expected: Number of steps by its settings, where these tell.
        parts: Runs within it.
    """

    path: Path
    kind: str
    lock: Path
    expected: int | None
    parts: list["_Node"] = field(default_factory=list)

    @cached_property
    def state(self) -> RunState:
        """Its notes."""
        return read_state(self.path)

    @cached_property
    def is_finished(self) -> bool:
        """Whether all is made."""
        return self.state.done or os.path.isfile(self.path / FINISHED)

    @cached_property
    def saved(self) -> tuple[int, list[str]]:
        """The step of the latest checkpoint that can be used, and what is wrong with newer ones."""
        faults = []
        for file in (self.path / name for name in CHECKPOINTS):
            if not os.path.isfile(file):
                continue
            try:
                return usable_step(file), faults
            except ModelError as error:
                faults.append(str(error))
        return 0, faults

    @property
    def is_lost(self) -> bool:
        """Whether there are checkpoints, none of which can be used."""
        return bool(self.saved[1]) and not self.saved[0]

    def all(self) -> Iterator["_Node"]:
        """Itself and all its parts."""
        yield self
        for part in self.parts:
            yield from part.all()

    def steps(self) -> int | None:
        """Number of steps in all."""
        own = self.state.steps or self.expected
        known = [steps for part in self.parts if (steps := part.steps()) is not None]
        return own or (sum(known) if known else None)

    def step(self, running: bool) -> int:
        """Number of steps that are done."""
        if self.is_finished and (steps := self.steps()) is not None:
            return steps
        own = _reached(self.path) if running else self.saved[0]
        return own + sum(part.step(running) for part in self.parts)


def _reached(folder: Path) -> int:
    """Number of steps of a run that goes on."""
    saved, entry = checkpoint_state(folder), latest_entry(folder)
    return max(0 if saved is None else saved["step"], 0 if entry is None else entry["step"] + 1)


def _told(node: _Node) -> Run:
    """What is to be said of an outermost run."""
    state, reason = _judged(node)
    left = state not in ("finished", "running")
    size, changed = _extent(node.path)
    return Run(
        node.path,
        node.kind,
        node.step(state == "running"),
        node.steps(),
        state,
        reason,
        _command(node) if left else "",
        changed,
        size,
    )


def _judged(node: _Node) -> tuple[State, str]:
    """What became of a run, and why."""
    if any(is_locked(one.lock) for one in node.all()):
        return "running", ""
    if node.is_finished:
        return "finished", ""
    if node.kind == "unknown":
        return "damaged", f"{node.path / SETTINGS} cannot be read."
    unfinished = [one for one in node.all() if not one.is_finished]
    for one in unfinished:
        if one.is_lost:
            return "damaged", f"{one.saved[1][0]} {LOST}"
    for one in unfinished:
        if one.state.failed is not None:
            return "failed", one.state.failed
    older = [fault for one in unfinished for fault in one.saved[1]]
    return "interrupted", f"{older[0]} It goes on from the one before." if older else ""


def _command(node: _Node) -> str:
    """The command by which a run goes on, where it now is."""
    state, now = node.state, str(resolved(node.path))
    if not _is_training(state.command):  # whoever wrote the notes may want something else run
        return ""
    words = list(state.command)
    if now != state.path:
        at = (os.path.abspath(os.path.join(state.folder, word)) for word in state.command)
        words = [now if path == state.path else word for path, word in zip(at, words, strict=True)]
    command = shlex.join(words)
    here = state.folder == os.getcwd()
    return command if here else f"cd {shlex.quote(state.folder)} && {command}"


def _is_training(command: tuple[str, ...]) -> bool:
    """Whether a command does nothing but train."""
    if not any(command[: 1 + len(verb)] == (PROGRAM, *verb) for verb in VERBS):
        return False
    if any(word.startswith(SERVING) for word in command):
        return False
    clusters = [after for word, after in pairwise((*command, "")) if word == RAY]
    clusters += [word.partition("=")[2] for word in command if word.startswith(f"{RAY}=")]
    return all(one == "auto" for one in clusters)


def _extent(folder: Path) -> tuple[int, float]:
    """Bytes of all files in a folder and below it, and when one of them was written last."""
    size, changed = 0, 0.0
    for place, _, files in walk(folder):
        for name in files:
            try:
                found = (place / name).lstat()
            except OSError:  # replaced in the meantime
                continue
            size += found.st_size
            changed = max(changed, found.st_mtime)
    return size, changed


def _nodes(folder: Path) -> list[_Node]:
    """The outermost runs in a folder, itself among them, each with those within it."""
    found: list[_Node] = []
    around: list[_Node] = []  # from the outermost to the innermost in which the next one may lie
    for place, folders, _ in walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        node = _node(place)
        if node is None:
            continue
        around = [one for one in around if node.path.is_relative_to(one.path)]
        (around[-1].parts if around else found).append(node)
        around = [*around, node][:WITHIN]
    return found


def _node(folder: Path) -> _Node | None:
    """A folder as a run; None if it is none."""
    for name, lock in ABOUT.items():
        if not os.path.isfile(folder / name):
            continue
        about = read_object(folder / name)
        kind = next((kind for entry, kind in KINDS.items() if entry in about), None)
        if kind is None and not about and _has_trained(folder):
            kind = "unknown"
        if kind is not None:
            return _Node(folder, kind, folder / lock, _expected(about, kind))
    return None


def _has_trained(folder: Path) -> bool:
    """Whether a folder whose settings are damaged is that of a run."""
    return any(os.path.isfile(folder / name) for name in (STATE, METRICS, *CHECKPOINTS))


def _expected(about: dict, kind: str) -> int | None:
    """The number of steps that settings tell: bodies have more than one training."""
    settings = about.get("settings")
    steps = settings.get("steps") if isinstance(settings, dict) else None
    return steps if kind in ("head", "scene") and is_step(steps) else None
