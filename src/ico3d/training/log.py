"""Writes the numbers of a training run: metrics.jsonl, TensorBoard and the progress bar."""

import json
import logging
import os
from collections.abc import Mapping
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from ico3d.common.files import MOST_NOTES, write_one_of_many
from ico3d.common.typed import loose_json

METRICS, BOARD = "metrics.jsonl", "tensorboard"
TAIL = 4096
"""Bytes at the end of a metrics file that are certain to contain a complete entry."""


LONGEST_LINE = 1 << 16
"""Bytes of an entry; what is longer is none."""


MOST_STEPS = 10**12
"""Steps that no run has; Python's whole numbers may have thousands of digits, and are not shown."""


class MetricsLog:
    """Appends numbers to `metrics.jsonl` and to TensorBoard's files.

    A resumed run first removes entries that the interrupted run wrote after its last checkpoint.
    """

    def __init__(self, folder: Path, first_step: int):
        """Opens the files in `folder` and removes entries from `first_step` on.

        Raises:
            StorageError: If the disk is nearly full.
        """
        logging.getLogger("tensorboard").setLevel(logging.ERROR)
        from torch.utils.tensorboard import SummaryWriter

        path = folder / METRICS
        size = _size(path)
        # In one piece: a run killed right here must not lose what earlier ones wrote.
        write_one_of_many(path, lambda to: _copy_before(path, size, first_step, to), size)
        self._file = path.open("a")
        self._board = SummaryWriter(str(folder / BOARD), purge_step=first_step)

    def write(self, step: int, values: Mapping[str, float]) -> None:
        """Appends the values of one step."""
        self._file.write(json.dumps({"step": step, **values}) + "\n")
        self._file.flush()
        for name, value in values.items():
            self._board.add_scalar(name, value, step)

    def close(self) -> None:
        """Closes the files."""
        self._file.close()
        self._board.close()


def _copy_before(path: Path, size: int, step: int, target: Path) -> None:
    """Writes the whole lines in the last bytes of a metrics file that belong to earlier steps.

    What a disk has damaged is dropped: no training depends on it.
    """
    with target.open("wb") as written:
        if not size:
            return
        with path.open("rb") as file:
            if file.seek(max(path.stat().st_size - size, 0)):
                file.readline(LONGEST_LINE)
            while line := file.readline(LONGEST_LINE):
                if line.endswith(b"\n") and _is_before(line, step):
                    written.write(line)


def _size(path: Path) -> int:
    """Bytes at the end of a metrics file that are kept; of what a link leads to, none."""
    is_ours = os.path.isfile(path) and not os.path.islink(path)
    return min(path.stat().st_size, MOST_NOTES) if is_ours else 0


def _is_before(line: bytes, step: int) -> bool:
    try:
        return loose_json(line)["step"] < step
    except (ValueError, LookupError, TypeError):
        return False


def latest_entry(folder: Path) -> dict | None:
    """The last entry of a run's metrics.jsonl, or None; a training may be writing to the file."""
    if not os.path.isfile(folder / METRICS):
        return None
    try:
        with (folder / METRICS).open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - TAIL, 0))
            whole = file.read().rpartition(b"\n")[0]
    except FileNotFoundError:
        return None
    try:
        entry = loose_json(whole.rpartition(b"\n")[2]) if whole else None
    except ValueError:  # damaged by the disk
        return None
    return entry if isinstance(entry, dict) and is_step(entry.get("step")) else None


def is_step(value: object) -> bool:
    """Whether a value that was read is the number of a step."""
    plain = isinstance(value, int) and not isinstance(value, bool)
    return plain and 0 <= value < MOST_STEPS


def readable(numbers: Mapping[str, float]) -> str:
    """The numbers as a short text, in the order in which the trainee returned them."""
    return "  ".join(f"{name} {value:.4g}" for name, value in numbers.items())


def progress_bar() -> Progress:
    """A progress bar with steps, remaining time and a text field `numbers`."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[numbers]}"),
    )
