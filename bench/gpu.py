"""The paper at its own size on a GPU: parity, speed, memory, frame rates, and training with a kill.

    python bench/gpu.py --out OUT [--wheels DIR] [--tiny]

Needs no data, no weights and no network: recordings are drawn, and weights are random. Writes
report.md and report.json into OUT. What fails is a row with its error, and the rest goes on; then
the exit status is 1, as it is when the backends differ too much. Where CUDA does not work the same
is measured on the CPU, parity is left out, and the report says why. On a bare machine with Python,
NumPy and torch for CUDA, --wheels names a folder with wheels of what else ico3d needs.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Part = Literal["parity", "drawing", "steps", "frames", "training"]


@dataclass(frozen=True)
class Bench:
    """What to measure.

    Attributes:
        out: Folder of the report, and of recordings and trainings; must be empty or new.
        wheels: Folder of wheels that are installed for this run alone, into a temporary folder.
        parts: What to measure; by default everything.
        tiny: Measure the least that goes through all of it, to see whether it works.
        device: Where to compute.
    """

    out: Path
    wheels: Path | None = None
    parts: tuple[Part, ...] = ("parity", "drawing", "steps", "frames", "training")
    tiny: bool = False
    device: Literal["auto", "cpu", "cuda"] = "auto"

    def run(self) -> int:
        """Measures, prints and writes the report; the exit status."""
        from full_size.parts import FULL, TINY
        from full_size.report import measure

        report, failed = measure(self.out, self.parts, TINY if self.tiny else FULL, self.device)
        print(report.markdown())
        return int(failed)


def _run() -> int:
    """Runs with what is installed, or again with the packages of the wheels that words name."""
    from full_size.wheels import run_with_wheels

    status = run_with_wheels(sys.argv)
    if status is not None:
        return status
    try:
        from ico3d.cli import run_script

        return run_script(Bench)
    except ModuleNotFoundError as error:
        print(f"{error.name} is not installed: --wheels DIR brings it along.", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(_run())
