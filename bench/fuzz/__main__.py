"""Does bad input end in one sentence, soon, and in little memory, whatever reads it?

    python bench/fuzz [--inputs 10000] [--only NAME …] [--json F]

Sound files of every kind are damaged: bytes, values of JSON, tensors, datasets of HDF5, claims of
headers, checksums made right again. Each damaged input is read in a process with bounds on time and
memory. Accepting it is fine, and so is one sentence that refuses it; everything else is a finding,
and the status is 1. The same seed makes the same inputs; `--only bundle --first 123 --inputs 1
--keep FOLDER` writes number 123 of a reader into a folder.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from ico3d.cli import run_script

BENCH = Path(__file__).parents[1]


@dataclass
class Fuzz:
    """Options.

    Attributes:
        inputs: Damaged inputs of each reader; of messages ten times as many.
        only: Names of readers; by default all.
        first: Number of the first input.
        seed: Seed of all damage.
        cpu: Seconds of processor time that one input may take.
        wall: Seconds that one input may take.
        memory: MiB that one input may take.
        keep: Folder for the first input of each finding, or for the only input.
        json: File for the figures.
    """

    inputs: int = 10_000
    only: tuple[str, ...] = ()
    first: int = 0
    seed: int = 0
    cpu: float = 10.0
    wall: float = 120.0
    memory: float = 512.0
    keep: Path | None = None
    json: Path | None = None

    def run(self) -> int:
        """Measures each reader and prints a table."""
        # the writers of sound files are those of the tests
        sys.path += [str(BENCH), str(BENCH.parent / "tests")]
        from fuzz.bounds import Bounds, measure
        from fuzz.readers import chosen
        from fuzz.report import keep, say, table

        outcomes = {}
        for reader in chosen(self.only):
            count = reader.times * self.inputs
            numbers = range(self.first, self.first + count)
            bounds = Bounds(self.cpu, self.wall, self.memory)
            outcomes[reader.name] = measure(reader, numbers, self.seed, bounds)
            say(reader.name, outcomes[reader.name])
            if self.keep is not None:
                kept = [self.first] if count == 1 else outcomes[reader.name].first.values()
                keep(reader, self.seed, kept, self.keep)
        table(outcomes, self.json)
        return int(any(outcome.findings for outcome in outcomes.values()))


if __name__ == "__main__":
    sys.exit(run_script(Fuzz))
