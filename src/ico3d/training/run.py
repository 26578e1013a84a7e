"""The folder of one training run: settings, checkpoints, metrics."""

import json
import logging
import os
from collections.abc import Mapping, Set
from pathlib import Path
from typing import Any

from torch import Tensor

from ico3d.common.files import json_of, remove_unfinished, write_atomic
from ico3d.errors import ModelError, SettingsError
from ico3d.training.checkpoint import check_seal, load_sealed, load_state, save_sealed
from ico3d.training.log import BOARD, is_step
from ico3d.training.notes.lock import locked
from ico3d.training.notes.state import begun, ended, note

log = logging.getLogger(__name__)

SETTINGS, FINISHED = "settings.json", "finished.json"
CHECKPOINT, BEFORE = "checkpoint.safetensors", "checkpoint.before.safetensors"
CHECKPOINTS = (CHECKPOINT, BEFORE)
"""The newest checkpoint, and the one before, for when the newest is damaged."""
PARTS = ("step", "seconds", "trainee")
"""What the state of a checkpoint tells."""
NESTED = "settings"
"""Key under which the options of the command line are stored; older runs store them unnested."""

FREE = ("cache_gib", "cache_dir")
"""Settings that a resumed run may have otherwise: they change no result."""


def goes_on(path: Path, settings: Mapping) -> bool:
    """Whether a folder holds no run, or one that goes on with these settings.

    Raises:
        ModelError: If the folder's settings are damaged.
    """
    file = path / SETTINGS
    if not os.path.exists(file):
        return True
    return not _differences(_read(file), json.loads(json.dumps(settings)))


def _differences(earlier: Mapping, now: Mapping) -> dict[str, tuple[Any, Any]]:
    """Settings of two runs that differ, by name, but for those in `FREE`."""
    one, other = _flat(earlier), _flat(now)
    return {
        name: (one.get(name), other.get(name))
        for name in sorted({*one, *other})
        if name.rpartition(".")[2] not in FREE and one.get(name) != other.get(name)
    }


class RunFolder:
    """The files of one training run, which no other process works at meanwhile.

    Attributes:
        path: The folder; created if missing.
        settings: The settings that the run was started with; a resumed run must have the same, but
            for those in `FREE`.
    """

    def __init__(self, path: Path, settings: Mapping):
        """Opens the folder for a run with these settings; removes unfinished files of killed runs.

        Raises:
            SettingsError: If the folder holds a run with other settings, or another process works
                at it.
            ModelError: If the folder's settings are damaged, or something else lies where the run
                writes.
        """
        self.path = path
        self.settings = json.loads(json.dumps(settings))
        self._usable = True  # whether the newest checkpoint is
        self.path.mkdir(parents=True, exist_ok=True)
        file = path / SETTINGS
        if os.path.exists(file):
            self._check_same(_read(file))
        else:
            write_atomic(file, json.dumps(self.settings, indent=1).encode())
        if self.finished() is not None:
            self._drop_checkpoints()  # killed after that was written
            return
        self._lock = locked(file)
        self._check_files()
        remove_unfinished(path)
        begun(path)

    def _check_files(self) -> None:
        """Raises ModelError if a folder lies in the place of a file, or a file in that of one."""
        for one in self.path.iterdir():
            if os.path.isdir(one) and one.suffix in (".json", ".jsonl", ".safetensors"):
                raise ModelError(f"{one} is a folder in the place of a file: move it away.")
        if os.path.exists(board := self.path / BOARD) and not os.path.isdir(board):
            raise ModelError(f"{board} is a file in the place of a folder: move it away.")

    def _check_same(self, earlier: dict) -> None:
        """Raises SettingsError if the folder's run was started with other settings."""
        if NESTED in self.settings and NESTED not in earlier:
            raise SettingsError(
                f"{self.path} holds a run that an earlier version of ico3d began, whose settings "
                "had other names: choose another folder, or remove it to start afresh."
            )
        for name, (before, now) in _differences(earlier, self.settings).items():
            raise SettingsError(
                f"{self.path} holds a run with another '{name}' ({before}, not {now}): choose "
                "another folder, or remove it to start afresh."
            )

    def checkpoint(self, names: Set[str] = frozenset()) -> tuple[dict[str, Tensor], dict] | None:
        """Tensors and state of the latest checkpoint that can be used, or None before the first.

        Args:
            names: Tensors that it must hold.

        Raises:
            ModelError: If there are checkpoints, and all of them are damaged; all are kept.
        """
        faults: list[ModelError] = []
        for file in (self.path / name for name in CHECKPOINTS):
            if not os.path.exists(file):
                continue
            try:
                found = _checked(file, names)
            except ModelError as error:
                faults.append(error)
                continue
            if faults:
                self._usable = False
                log.warning(
                    "%s Training goes on from the checkpoint before, at step %d.",
                    faults[0],
                    found[1]["step"],
                )
            return found
        if faults:
            raise ModelError.of(
                "checkpoint",
                f"{faults[0]} There is no other checkpoint that can be used in {self.path}: ",
                f" Put a copy of {CHECKPOINT} there, or move the damaged ones away to begin "
                "afresh; nothing was removed.",
            )
        return None

    def save_checkpoint(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Writes the newest checkpoint; the one before is kept, unless it is damaged."""
        before = self.path / BEFORE if self._usable else None
        save_sealed(self.path / CHECKPOINT, tensors, state, before)
        self._usable = True

    def expect(self, steps: int) -> None:
        """Notes how many optimisation steps the run has."""
        note(self.path, steps=steps)

    def finish(self, summary: dict) -> None:
        """Marks the run as finished, with a summary, and deletes its checkpoints."""
        write_atomic(self.path / FINISHED, json.dumps(summary, indent=1).encode())
        ended(self.path)
        self._drop_checkpoints()

    def finished(self) -> dict | None:
        """The summary of a finished run, or None.

        Raises:
            ModelError: If it is damaged.
        """
        file = self.path / FINISHED
        return _read(file) if os.path.exists(file) else None

    def _drop_checkpoints(self) -> None:
        for name in CHECKPOINTS:
            (self.path / name).unlink(missing_ok=True)


def checkpoint_state(folder: Path) -> dict | None:
    """The state of a run's latest checkpoint, or None before the first.

    Unlike opening a `RunFolder`, this changes nothing in the folder, so the run may be going on.
    """
    for name in CHECKPOINTS:
        try:
            return _told(folder / name, load_state(folder / name))
        except ModelError:
            continue
    return None


def usable_step(file: Path) -> int:
    """After which step a checkpoint was written; the whole file is read for damage.

    Raises:
        ModelError: If it is damaged.
    """
    check_seal(file)
    return _told(file, load_state(file))["step"]


def _checked(file: Path, names: Set[str]) -> tuple[dict[str, Tensor], dict]:
    """A checkpoint that holds what it must.

    Raises:
        ModelError: If it is damaged, or of another training.
    """
    tensors, state = load_sealed(file)
    missing = sorted(names - tensors.keys())
    if missing:
        raise ModelError(f"{file} is of another training: it has no '{missing[0]}'.")
    return tensors, _told(file, state)


def _told(file: Path, state: object) -> dict:
    """Raises ModelError if the state of a checkpoint lacks a part."""
    if not isinstance(state, dict) or not state.keys() >= set(PARTS) or not is_step(state["step"]):
        raise ModelError(f"{file} is no checkpoint of a training.")
    return state


def _read(file: Path) -> dict:
    """The content of a JSON file.

    Raises:
        ModelError: If it is damaged.
    """
    try:
        found = json_of(file)
    except (OSError, ValueError) as error:
        raise ModelError(_damaged(file)) from error
    if not isinstance(found, dict):
        raise ModelError(_damaged(file))
    return found


def _damaged(file: Path) -> str:
    return (
        f"{file} is damaged: put a copy of it there, or choose another folder to begin afresh; "
        "nothing was removed."
    )


def _flat(settings: Mapping, prefix: str = "") -> dict[str, object]:
    """Settings by the names that the command line has for them."""
    found: dict[str, object] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            found |= _flat(value, "" if name == NESTED else f"{prefix}{name}.")
        else:
            found[prefix + name] = value
    return found
