"""Of which files of a recording an avatar is made."""

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ico3d.recording.keeping.person import Part, Person
from ico3d.recording.keeping.plan import CONSENT, UPLOAD, part_ids


@dataclass(frozen=True)
class Recorded:
    """What was recorded of a person when somebody looked.

    Attributes:
        consent: What they agreed to, with the language in which they read.
        parts: The parts by name, kept ones and those whose recording broke off.
    """

    consent: Mapping[str, Any]
    parts: Mapping[str, Part]

    @classmethod
    def of(cls, person: Person) -> "Recorded":
        """What is recorded now.

        Raises:
            Refused: If the person's consent is damaged.
        """
        return cls(person.consent(), {part.id: part for part in person.parts()})

    @property
    def language(self) -> str:
        """The language in which they read."""
        return self.consent["language"]

    @property
    def sources(self) -> list[Path]:
        """The video that was brought, or the parts in their order; none where nothing is there."""
        return [part.file for part in self._made_into_one()]

    @property
    def seconds(self) -> float:
        """Length of the video that an avatar would be made of; 0 where nothing is recorded."""
        reports = [part.report for part in self._made_into_one()]
        return sum(float(report["seconds"]) for report in reports if report is not None)

    def _made_into_one(self) -> list[Part]:
        kept = {id: part for id, part in self.parts.items() if part.report is not None}
        ids = [UPLOAD] if UPLOAD in kept else part_ids(self.language)
        return [kept[id] for id in ids if id in kept and id != CONSENT]


def signature(files: Sequence[Path]) -> list[list]:
    """What tells these files from others, and from other takes under the same names.

    One that is gone, since it was recorded anew meanwhile, is left out.
    """
    told: list[list] = []
    for file in files:
        with contextlib.suppress(FileNotFoundError):
            about = os.stat(file)
            told.append([file.name, about.st_size, about.st_mtime])
    return told
