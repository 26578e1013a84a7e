"""Finds the files of a RenderMe-360 recording."""

import os
from dataclasses import dataclass
from pathlib import Path

from ico3d.capture.smc.finding_files import only_one, smc_files
from ico3d.errors import CaptureError

RAW, ANNOTATIONS = "_raw", "_anno"


@dataclass(frozen=True)
class Files:
    """The files of one recording.

    Attributes:
        raw: File with the pictures, and often the sound.
        annotations: File with masks, calibration, FLAME and keypoints; None if not downloaded.
    """

    raw: Path
    annotations: Path | None

    @property
    def name(self) -> str:
        """Person and part of the recording, such as "0026_e0"."""
        return self.raw.stem.removesuffix(RAW)

    @property
    def part(self) -> str:
        """The performed part: "e" and a number for expressions, "h…" for hair, "s…" for speech."""
        return self.name.partition("_")[2]


def is_recording(path: Path) -> bool:
    """Whether a path is an SMC file named as in RenderMe-360, or a folder that holds one."""
    return any(p.stem.endswith((RAW, ANNOTATIONS)) for p in _candidates(path))


def find_files(path: Path) -> Files:
    """Finds the files that belong to one recording.

    Annotations lie beside the raw file, or where the data set puts them: in a folder "anno" beside
    the folder "raw".

    Args:
        path: The raw file, or a folder that holds one recording.

    Raises:
        CaptureError: If the folder holds several recordings, or pictures are missing.
    """
    if os.path.isfile(path) and not path.stem.endswith(RAW):
        raise CaptureError(f"{path} has no pictures: name the file that ends in _raw.smc instead.")
    raws = [p for p in _candidates(path) if p.stem.endswith(RAW)]
    raw = only_one(path, raws)
    name = f"{raw.stem.removesuffix(RAW)}{ANNOTATIONS}.smc"
    places = [raw.with_name(name), _in_annotations(raw.absolute()).with_name(name)]
    return Files(raw, next((place for place in places if os.path.isfile(place)), None))


def _candidates(path: Path) -> list[Path]:
    """The file itself, or those in a folder."""
    return smc_files(path) if os.path.isdir(path) else [path] if path.suffix == ".smc" else []


def _in_annotations(raw: Path) -> Path:
    """The same path below "anno" where it lies below "raw"."""
    parts = list(raw.parts)
    for index in reversed(range(len(parts) - 1)):
        if parts[index] == RAW[1:]:
            parts[index] = ANNOTATIONS[1:]
            break
    return Path(*parts)
