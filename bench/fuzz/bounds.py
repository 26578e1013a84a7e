"""Runs a reader in a process of its own, with bounds on the time and memory of each input."""

import ctypes
import gc
import json
import logging
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

from fuzz.reader import Bench, Reader

KILLED = {
    signal.SIGPROF: "too much processor time",
    signal.SIGALRM: "hangs",
    signal.SIGSEGV: "crash",
    signal.SIGABRT: "crash",
    signal.SIGBUS: "crash",
    signal.SIGKILL: "out of memory",
}
ROOM = 8
"""Times the bound on memory that the process may map at all, so that a bomb ends there."""


@dataclass(frozen=True)
class Bounds:
    """What one input may take.

    Attributes:
        cpu: Seconds of processor time.
        wall: Seconds.
        memory: MiB.
    """

    cpu: float
    wall: float
    memory: float


@dataclass
class Outcome:
    """What became of a reader's inputs.

    Attributes:
        inputs: How many were read.
        refused: How many of them were refused in one sentence.
        longest: Most seconds of processor time of one input.
        most: Most memory in MiB that one input added.
        seconds: Seconds of processor time of all inputs.
        findings: How often something else happened, by what it was.
        first: Number of the first input of each finding.
    """

    inputs: int = 0
    refused: int = 0
    longest: float = 0.0
    most: float = 0.0
    seconds: float = 0.0
    findings: Counter = field(default_factory=Counter)
    first: dict[str, int] = field(default_factory=dict)

    def add(self, number: int, finding: str) -> None:
        """Notes a finding."""
        self.findings[finding] += 1
        self.first.setdefault(finding, number)


def input_of(bench: Bench, reader: Reader, seed: int, number: int) -> dict[str, bytes]:
    """The input of a number: the same at every run."""
    return bench.input(Random(f"{seed} {reader.name} {number}"))


def measure(reader: Reader, numbers: range, seed: int, bounds: Bounds) -> Outcome:
    """Reads inputs; where one ends the process, another process goes on behind it."""
    outcome, at = Outcome(), numbers.start
    while at < numbers.stop:
        receiving, sending = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(receiving)
            _work(reader, range(at, numbers.stop), seed, bounds, sending)
        os.close(sending)
        for number, report in _reports(receiving):
            _count(outcome, number, report, bounds)
            at = number + 1
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if status > 0:
            raise RuntimeError(f"{reader.name}: its sound inputs are not read.")
        if status < 0:
            outcome.inputs += 1
            outcome.add(at, KILLED.get(signal.Signals(-status), signal.Signals(-status).name))
            at += 1
    return outcome


def _reports(receiving: int) -> Iterator[tuple[int, dict]]:
    with os.fdopen(receiving) as lines:
        for line in lines:
            report = json.loads(line)
            yield report["number"], report


def _count(outcome: Outcome, number: int, report: dict, bounds: Bounds) -> None:
    outcome.inputs += 1
    outcome.refused += report["refused"]
    outcome.seconds += report["cpu"]
    outcome.longest = max(outcome.longest, report["cpu"])
    outcome.most = max(outcome.most, report["memory"])
    if report["finding"]:
        outcome.add(number, report["finding"])
    if report["memory"] > bounds.memory:
        outcome.add(number, f"more than {bounds.memory:g} MiB")


def _work(reader: Reader, numbers: range, seed: int, bounds: Bounds, sending: int) -> None:
    """The process: reads input after input and reports each; never returns."""
    status = 1
    try:
        logging.disable()
        for bound in (signal.SIGPROF, signal.SIGALRM):
            signal.signal(bound, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGPROF, signal.SIGALRM))
        with (
            tempfile.TemporaryDirectory() as folder,
            os.fdopen(sending, "w", buffering=1) as reports,
            redirect_stderr(open(os.devnull, "w")),
        ):
            bench = Bench(reader, Path(folder))
            gc.collect()  # what the parent left, and is freed while an input is read, hides growth
            gc.freeze()
            _limit_memory(bounds)
            for number in numbers:
                files = input_of(bench, reader, seed, number)
                report = _one(bench, files, bounds)
                reports.write(json.dumps({"number": number, **report}) + "\n")
        status = 0
    except BaseException:
        traceback.print_exc(file=sys.__stderr__)
    finally:
        os._exit(status)


def _one(bench: Bench, files: dict[str, bytes], bounds: Bounds) -> dict:
    """Reads one input; the system ends the process where it takes too long."""
    gc.collect()  # what earlier inputs left is no growth of this one, and its end hides none
    ctypes.CDLL(None).malloc_trim(0)  # else a free block, kept for later, is used again unseen
    Path("/proc/self/clear_refs").write_text("5")  # the highest memory so far is forgotten
    before = _resident()
    began, finding, accepted = time.process_time(), "", False
    signal.setitimer(signal.ITIMER_PROF, bounds.cpu)
    signal.setitimer(signal.ITIMER_REAL, bounds.wall)
    try:
        accepted = bench.run(files)
    except Exception as error:
        finding = _named(error)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
    # the system may take pages back meanwhile, of libraries or freed ones: they hide no growth
    base = sum(map(min, before, _resident()))
    return {
        "refused": not accepted and not finding,
        "cpu": time.process_time() - began,
        "memory": (_memory("VmHWM") - base) / 1024,
        "finding": finding,
    }


def _named(error: Exception) -> str:
    """An error with the last line of ico3d that it passed: what makes two findings one."""
    frames = [
        frame for frame in traceback.extract_tb(error.__traceback__) if "ico3d" in frame.filename
    ]
    place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}{place}: {str(error)[:120]!r}"


def _resident() -> tuple[int, int]:
    """What is in memory of the process's own pages, and of files, KiB."""
    return _memory("RssAnon") + _memory("RssShmem"), _memory("RssFile")


def _memory(name: str) -> int:
    """A line of the process's status, KiB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(name):
            return int(line.split()[1])
    return 0


def _limit_memory(bounds: Bounds) -> None:
    """What is mapped may grow by a multiple of the bound and no more."""
    most = _memory("VmSize") * 1024 + int(ROOM * bounds.memory * 2**20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
