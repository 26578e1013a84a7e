"""Which files make a RenderMe-360 recording."""

from dataclasses import dataclass
from pathlib import Path

from ico3d.capture.smc.finding_files import only_one, smc_files
from ico3d.errors import CaptureError

RAW, ANNOTATIONS = "_raw", "_anno"


@dataclass(frozen=True)
class Files:
    """The files of one recording.

    Attributes:
        raw: Pictures, and often the sound.
        annotations: Masks, calibration, FLAME, keypoints; None where they were not fetched.
    """

    raw: Path
    annotations: Path | None

    @property
    def name(self) -> str:
        """Person and part, such as "0026_e0"."""
        return self.raw.stem.removesuffix(RAW)

    @property
    def part(self) -> str:
        """What was performed: "e" and a number for expressions, "h…" hair, "s…" speech."""
        return self.name.partition("_")[2]


def is_recording(path: Path) -> bool:
    """Whether a path is, or a folder holds, an SMC file named as RenderMe-360 names them."""
    return any(p.stem.endswith((RAW, ANNOTATIONS)) for p in _candidates(path))


def find_files(path: Path) -> Files:
    """Finds what belongs together.

    Annotations lie beside the raw file, or where the data set has them: in a folder "anno" that
    has the place of the folder "raw".

    Args:
        path: The raw file, or a folder that holds one recording.

    Raises:
        CaptureError: If there are several recordings, or there are no pictures.
    """
    if path.is_file() and not path.stem.endswith(RAW):
        raise CaptureError(f"{path} has no pictures: name the file that ends in _raw.smc instead.")
    raws = [p for p in _candidates(path) if p.stem.endswith(RAW)]
    raw = only_one(path, raws)
    name = f"{raw.stem.removesuffix(RAW)}{ANNOTATIONS}.smc"
    places = [raw.with_name(name), _in_annotations(raw.absolute()).with_name(name)]
    return Files(raw, next((place for place in places if place.is_file()), None))


def _candidates(path: Path) -> list[Path]:
    """The file itself, or those in a folder."""
    return smc_files(path) if path.is_dir() else [path] if path.suffix == ".smc" else []


def _in_annotations(raw: Path) -> Path:
    """The same path below "anno" where it lies below "raw"."""
    parts = list(raw.parts)
    for index in reversed(range(len(parts) - 1)):
        if parts[index] == RAW[1:]:
            parts[index] = ANNOTATIONS[1:]
            break
    return Path(*parts)
