"""What is fuzzed: a reader, and sound inputs for it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

from fuzz.damage.files import Files, damaged
from ico3d.errors import Ico3dError

LONGEST_SENTENCE = 1100


class Unclear(Exception):
    """A refusal that is not one clear sentence."""


@dataclass(frozen=True)
class Reader:
    """A reader of files that may come from anywhere.

    Attributes:
        name: What it reads.
        samples: Functions that write sound files into an empty folder, by name.
        start: Makes the function that reads such a folder.
        times: Inputs of this reader for each of others.
    """

    name: str
    samples: dict[str, Callable[[Path], object]]
    start: Callable[[], Callable[[Path], object]]
    times: int = 1


class Bench:
    """A reader on a folder in which its sound inputs are damaged one after the other."""

    def __init__(self, reader: Reader, folder: Path):
        """Writes the sound inputs, and reads each once.

        Raises:
            Ico3dError: If a sound input is refused.
        """
        self._reader, self._read = reader, reader.start()
        self._place, self._lying = folder / "input", {}
        self._sound: list[Files] = []
        for name, write in reader.samples.items():
            made = folder / name
            made.mkdir(parents=True)
            write(made)
            self._sound.append(_contents(made))
            self._lay(self._sound[-1])
            self._read(self._place)

    def input(self, random: Random) -> Files:
        """A damaged input."""
        return damaged(random.choice(self._sound), random)

    def run(self, files: Files) -> bool:
        """Reads an input; returns whether it was accepted, refused otherwise.

        Raises:
            Unclear: If it was refused in other than one clear sentence.
            Exception: Whatever else the reader raises.
        """
        self._lay(files)
        try:
            self._read(self._place)
        except Ico3dError as error:
            check_sentence(str(error))
            return False
        return True

    def _lay(self, files: Files) -> None:
        """Writes what differs from what lies there."""
        self._place.mkdir(exist_ok=True)
        for name in self._lying.keys() - files.keys():
            (self._place / name).unlink(missing_ok=True)
        for name, content in files.items():
            if self._lying.get(name) != content:
                (self._place / name).parent.mkdir(parents=True, exist_ok=True)
                (self._place / name).write_bytes(content)
        self._lying = files


def check_sentence(sentence: str) -> None:
    """Checks that a refusal is one sentence that a terminal can show.

    Raises:
        Unclear: If it is not.
    """
    faults = {
        "has no end": sentence[-1:] not in tuple(".?!"),
        "has several lines or unprintable characters": not sentence.isprintable(),
        f"is longer than {LONGEST_SENTENCE} characters": len(sentence) > LONGEST_SENTENCE,
    }
    for fault, found in faults.items():
        if found:
            raise Unclear(f"the sentence {fault}")


def _contents(folder: Path) -> Files:
    """All files below a folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
