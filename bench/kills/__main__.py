"""Do trainings that are killed again and again end with the same files, bit for bit?

    python bench/kills SUBJECT.npz OUT [--kills 50] [--seed 0] [--markdown F]

Records a small synthetic person and trains a head, trains a body and assembles both by the command
line: twice at a stretch, of which the first compiles kernels, and then again and again with
SIGKILL. The moments are drawn evenly from the processor time between the first file of a run at a
stretch and its end, so that it does not matter what else the machine does; every fourth is drawn
from the first half, and the kill then waits until a file is being written. After each kill `ico3d
runs` must call the run interrupted, and the command that it shows goes on. A run that was killed
often enough, or comes through, is compared with the one at a stretch: all files but logs of
TensorBoard and notes of commands, without the seconds that training took. The status is 1 unless
all are alike.
"""

import json
import os
import random
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import tyro
from rich.console import Console

from ico3d.cli import run_script
from ico3d.errors import ModelError
from ico3d.training.listing.find_runs import find_runs
from ico3d.training.notes.state import STATE, read_state
from ico3d.training.run import CHECKPOINTS, FINISHED, SETTINGS

SMALL = ("--initial.gaussians", "300", "--density.max-gaussians", "600", "--density.begin", "20")
HEAD = (
    *("--inputs", "blendshapes", "--steps", "240", "--checkpoint-every", "10"),
    *("--density.every", "20", *SMALL),
)
BODY = (
    *("--steps-per-frame", "16", "--warmup-steps", "10", "--checkpoint-every", "8"),
    *("--density.every", "10", "--windows.longest", "6", "--windows.shortest", "3"),
    *("--finetune.steps", "24", *SMALL),
)
UNFINISHED = re.compile(r"\..+\.[0-9a-f]{16}(\..*)?")
"""Names of files that are being written."""
TICKS = os.sysconf("SC_CLK_TCK")
"""Of the clock of processor time, in a second."""
ONE_THREAD = {name: "1" for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS")}


@dataclass(frozen=True)
class Task:
    """What is trained.

    Attributes:
        kind: Its name in the table.
        verb: The verb, and what it takes, before the folder to write.
        options: What stands behind that folder.
    """

    kind: str
    verb: tuple[str, ...]
    options: tuple[str, ...]

    def words(self, folder: str) -> tuple[str, ...]:
        """The words of the command that writes into a folder."""
        return ("ico3d", *self.verb, folder, *self.options)


TASKS = (
    Task("head", ("train", "head", "head-capture"), HEAD),
    Task("body", ("train", "body", "body-capture"), BODY),
    Task("assemble", ("assemble", "head-whole", "body-capture"), BODY),
)


@dataclass
class Tally:
    """What came of the kills of a task.

    Attributes:
        kills: Number of kills.
        early: Kills before the run's first checkpoint.
        writing: Kills while a file was being written.
        steps: The steps that training could go on from, after each kill.
        runs: Kills of each run that was brought to its end.
        other: Files that differ, by run.
        files: Number of files that are compared in each run.
    """

    kills: int = 0
    early: int = 0
    writing: int = 0
    steps: list[int] = field(default_factory=list)
    runs: list[int] = field(default_factory=list)
    other: dict[str, list[str]] = field(default_factory=dict)
    files: int = 0


@dataclass(frozen=True)
class Kills:
    """The bench.

    Attributes:
        subject: The subject file of whoever is recorded.
        out: Where recordings and models lie; must be empty.
        kills: Number of kills in all.
        seed: Seed of the moments.
        markdown: Also write the table here.
    """

    subject: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    kills: int = 50
    seed: int = 0
    markdown: Path | None = None

    def run(self) -> int:
        """Trains, kills, compares and prints a table; the exit status.

        Raises:
            ModelError: If a command fails.
        """
        self.out.mkdir(parents=True, exist_ok=True)
        self._record()
        console, rng = Console(highlight=False, soft_wrap=True), random.Random(self.seed)
        tallies: dict[str, Tally] = {}
        for number, task in enumerate(TASKS):
            share = len(range(number, self.kills, len(TASKS)))
            tally = tallies[task.kind] = killed_often(task, self.out, share, rng)
            console.print(f"{task.kind}: {tally}")
        rows = table(tallies)
        print(rows)
        if self.markdown:
            self.markdown.write_text(rows + "\n")
        return int(any(tally.other for tally in tallies.values()))

    def _record(self) -> None:
        """Head and shoulders by two cameras, and the whole person by six."""
        record = ("ico3d", "capture", "synthetic", "--subject", str(self.subject.resolve()))
        bust = ("head-capture", "--cameras", "2", "--frames", "22", "--size", "64")
        whole = ("body-capture", "--rig", "body", "--cameras", "6", "--frames", "7", "--size", "96")
        for words in (bust, whole):
            if not (self.out / words[0]).exists():
                _end(_start((*record, *words), self.out), words)


def killed_often(task: Task, out: Path, kills: int, rng: random.Random) -> Tally:
    """Trains at a stretch, and then with kills, until there were enough.

    Raises:
        ModelError: If a command fails, or `ico3d runs` does not know how a run goes on.
    """
    at_a_stretch(task, out, f"{task.kind}-first")
    span = at_a_stretch(task, out, f"{task.kind}-whole")
    expected = dict(contents(out / f"{task.kind}-whole"))
    tally = Tally(files=len(expected))
    while tally.kills < kills:
        folder = out / f"{task.kind}-{len(tally.runs)}"
        before = tally.kills
        while _is_killed(task, folder, span, kills, rng, tally):
            pass
        tally.runs.append(tally.kills - before)
        found = dict(contents(folder))
        names = expected.keys() | found.keys()
        other = sorted(name for name in names if expected.get(name) != found.get(name))
        if other:
            tally.other[folder.name] = other
    return tally


def at_a_stretch(task: Task, out: Path, folder: str) -> tuple[float, float]:
    """Trains without a kill; processor seconds until the first file, and until the end."""
    words = task.words(folder)
    process, first, used = _start(words, out), 0.0, 0.0
    while process.poll() is None:
        used = _processor_seconds(process) or used
        if not first and (out / folder / SETTINGS).exists():
            first = used
        time.sleep(0.005)
    _end(process, words)
    return first, used


def _is_killed(
    task: Task,
    folder: Path,
    span: tuple[float, float],
    kills: int,
    rng: random.Random,
    tally: Tally,
) -> bool:
    """Begins a run or goes on with it, and kills it at a random moment; whether it came to that.

    Raises:
        ModelError: If the command fails, or `ico3d runs` does not know how the run goes on.
    """
    words = read_state(folder).command or task.words(folder.name)
    process = _start(words, folder.parent)
    if tally.kills == kills:
        _end(process, words)
        return False
    waits = tally.kills % 4 == 3
    share, late = rng.random() / (2 if waits else 1), rng.random()
    moment = span[0] + share * (span[1] - span[0])
    while process.poll() is None and _processor_seconds(process) < moment:
        time.sleep(0.001)
    time.sleep(late / TICKS)
    while waits and process.poll() is None and not _is_writing(folder):
        pass
    process.kill()
    if process.wait() != -9:
        _end(process, words)
        return False
    tally.kills += 1
    tally.writing += _is_writing(folder)
    tally.early += not any(list(folder.rglob(name)) for name in (*CHECKPOINTS, FINISHED))
    tally.steps.append(_step_of(folder, words))
    return True


def _step_of(folder: Path, words: tuple[str, ...]) -> int:
    """The step from which a killed run goes on, as `ico3d runs` lists it.

    Raises:
        ModelError: If that does not list it as one that goes on by its command.
    """
    runs = find_runs(folder) if folder.exists() else []
    if not runs:  # killed before it wrote anything
        return 0
    (run,) = runs
    if run.state not in ("interrupted", "finished") or read_state(folder).command not in (
        words,
        (),  # killed before it noted the command
    ):
        raise ModelError(f"{folder} was killed, and ico3d runs lists {run}.")
    return run.step


def _processor_seconds(process: subprocess.Popen) -> float:
    """Processor time that a process has used, in whole ticks; 0 once it has ended."""
    try:
        told = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(told[11]) + int(told[12])) / TICKS


def _is_writing(folder: Path) -> bool:
    """Whether a file is being written, or was when its writer was killed."""
    try:
        entries = list(os.scandir(folder))
    except OSError:  # not yet there
        return False
    return any(UNFINISHED.fullmatch(entry.name) for entry in entries) or any(
        _is_writing(Path(entry.path)) for entry in entries if entry.is_dir()
    )


def _start(words: tuple[str, ...], out: Path) -> subprocess.Popen:
    """A process that runs a command in a folder; what it says goes into a file there."""
    with (out / "said.txt").open("ab") as said:
        command = [sys.executable, "-m", "ico3d.cli", *words[1:]]
        return subprocess.Popen(
            command, cwd=out, env=os.environ | ONE_THREAD, stdout=said, stderr=said
        )


def _end(process: subprocess.Popen, words: tuple[str, ...]) -> None:
    """Waits for the end of a process.

    Raises:
        ModelError: If it fails.
    """
    if process.wait():
        raise ModelError(f"{' '.join(words[:4])} ended with status {process.returncode}.")


def contents(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Name and content of every file of a run that must be as at a stretch."""
    for file in sorted(folder.rglob("*")):
        name = file.relative_to(folder)
        if not file.is_file() or "tensorboard" in name.parts or name.name == STATE:
            continue
        content = file.read_bytes()
        if file.suffix == ".json":
            content = json.dumps(_timeless(json.loads(content))).encode()
        yield str(name), content


def _timeless(value: object) -> object:
    """A value of JSON without the seconds that training took."""
    if isinstance(value, dict):
        return {key: _timeless(v) for key, v in value.items() if key != "train_seconds"}
    return [_timeless(v) for v in value] if isinstance(value, list) else value


def table(tallies: dict[str, Tally]) -> str:
    """The figures as a table of Markdown."""
    lines = [
        "| | kills | before the first checkpoint | while a file was written | runs "
        "| most kills of a run | files compared | kills that ended in the same files |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for kind, tally in tallies.items():
        most, same = max(tally.runs), tally.kills
        for name in tally.other:
            same -= tally.runs[int(name.rpartition("-")[2])]
        lines.append(
            f"| {kind} | {tally.kills} | {tally.early} | {tally.writing} | {len(tally.runs)} "
            f"| {most} | {tally.files} | {same} of {tally.kills} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(run_script(Kills))
