"""The folder of one training run: settings, checkpoint, metrics."""

import json
from collections.abc import Mapping
from pathlib import Path

from torch import Tensor

from ico3d.common.files import remove_unfinished, write_atomic
from ico3d.errors import ModelError, SettingsError
from ico3d.training.checkpoint import load_state, load_tensors, save_tensors

CHECKPOINT = "checkpoint.safetensors"
NESTED = "settings"
"""Key under which the options of the command line are stored; older runs store them unnested."""

FREE = ("cache_gib", "cache_dir")
"""Settings that a resumed run may have otherwise: they change no result."""


class RunFolder:
    """The files of one training run.

    Attributes:
        path: The folder; created if missing.
        settings: The settings that the run was started with; a resumed run must have the same, but
            for those in `FREE`.
    """

    def __init__(self, path: Path, settings: Mapping):
        """Opens the folder for a run with these settings; removes unfinished files of killed runs.

        Raises:
            SettingsError: If the folder holds a run with other settings.
        """
        self.path = path
        self.settings = json.loads(json.dumps(settings))
        self.path.mkdir(parents=True, exist_ok=True)
        remove_unfinished(self.path)
        if self.finished() is not None:  # killed after that was written
            self._checkpoint_file.unlink(missing_ok=True)
        file = path / "settings.json"
        if not file.exists():
            write_atomic(file, json.dumps(self.settings, indent=1).encode())
            return
        self._check_same(json.loads(file.read_text()))

    def _check_same(self, earlier: dict) -> None:
        """Raises SettingsError if the folder's run was started with other settings."""
        if NESTED in self.settings and NESTED not in earlier:
            raise SettingsError(
                f"{self.path} holds a run that an earlier version of ico3d began, whose settings "
                "had other names: choose another folder, or remove it to start afresh."
            )
        before, now = _flat(earlier), _flat(self.settings)
        for name in sorted({*before, *now}):
            free = name.rpartition(".")[2] in FREE
            if not free and before.get(name) != now.get(name):
                raise SettingsError(
                    f"{self.path} holds a run with another '{name}' ({before.get(name)}, not "
                    f"{now.get(name)}): choose another folder, or remove it to start afresh."
                )

    @property
    def _checkpoint_file(self) -> Path:
        return self.path / CHECKPOINT

    def checkpoint(self) -> tuple[dict[str, Tensor], dict] | None:
        """Tensors and state of the latest checkpoint, or None before the first."""
        file = self._checkpoint_file
        return load_tensors(file) if file.exists() else None

    def save_checkpoint(self, tensors: dict[str, Tensor], state: dict) -> None:
        """Replaces the checkpoint."""
        save_tensors(self._checkpoint_file, tensors, state)

    def finish(self, summary: dict) -> None:
        """Marks the run as finished, with a summary, and deletes its checkpoint."""
        write_atomic(self.path / "finished.json", json.dumps(summary, indent=1).encode())
        self._checkpoint_file.unlink(missing_ok=True)

    def finished(self) -> dict | None:
        """The summary of a finished run, or None."""
        file = self.path / "finished.json"
        return json.loads(file.read_text()) if file.exists() else None


def checkpoint_state(folder: Path) -> dict | None:
    """The state of a run's latest checkpoint, or None before the first.

    Unlike opening a `RunFolder`, this changes nothing in the folder, so the run may be going on.
    """
    try:
        return load_state(folder / CHECKPOINT)
    except ModelError:
        return None


def _flat(settings: Mapping, prefix: str = "") -> dict[str, object]:
    """Settings by the names that the command line has for them."""
    found: dict[str, object] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            found |= _flat(value, "" if name == NESTED else f"{prefix}{name}.")
        else:
            found[prefix + name] = value
    return found
