"""Of which files of a recording an avatar is made."""

from collections.abc import Sequence
from pathlib import Path

from ico3d.recording.keeping.person import Person, with_stat
from ico3d.recording.keeping.plan import CONSENT, UPLOAD, part_ids


def sources(person: Person) -> list[Path]:
    """The video that was brought, or the parts in their order; none where nothing is recorded."""
    parts = {part.id: part.file for part in person.parts() if part.report is not None}
    ids = [UPLOAD] if UPLOAD in parts else part_ids(person.consent()["language"])
    return [parts[id] for id in ids if id in parts and id != CONSENT]


def recorded_seconds(person: Person) -> float:
    """Length of the video that an avatar would be made of; 0 where nothing is recorded."""
    names = {file.stem for file in sources(person)}
    reports = (part.report for part in person.parts() if part.id in names)
    return sum(float(report["seconds"]) for report in reports if report is not None)


def signature(files: Sequence[Path]) -> list[list]:
    """What tells these files from others, and from other takes under the same names."""
    return [[file.name, told.st_size, told.st_mtime] for file, told in with_stat(files)]
