"""Parts as the studio page records them, tiny, and somebody whose parts they are."""

from datetime import date
from pathlib import Path

import numpy as np

from ico3d.avatar.film.video import write_video
from ico3d.capture.capture import Sound
from ico3d.recording.keeping.people import People
from ico3d.recording.keeping.person import Person

SIDE, DAY = 64, date(2026, 11, 24)


def part_file(
    path: Path, frames: int = 25, level: int = 120, size=(SIDE, SIDE), sound=True
) -> Path:
    """A video with a tone, as grey as `level`, at 25 pictures per second."""
    pictures = (np.full((*size[::-1], 3), level + i % 2, np.uint8) for i in range(frames))
    tone = 0.2 * np.sin(np.arange(640 * frames) / 9).astype(np.float32)
    write_video(path, pictures, size, 25.0, Sound(tone, 16_000) if sound else None)
    return path


def begun(folder: Path, name: str = "Ida", language: str = "en") -> Person:
    """Somebody who has agreed by a tick."""
    return People(folder).begin(name, language, True, DAY)


def kept(person: Person, id: str, data: bytes, **report) -> None:
    """Records a part and keeps it."""
    person.append(id, "take", 0, data)
    person.keep(id, "take", {"seconds": 1.0, "turn": None, "advice": []} | report)
