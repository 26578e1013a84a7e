"""Finds the files of a DNA-Rendering recording."""

import os
from dataclasses import dataclass
from pathlib import Path

from ico3d.capture.smc.finding_files import only_one, smc_files
from ico3d.errors import CaptureError

ANNOTATIONS, KINECT = "_annots", "_kinect"


@dataclass(frozen=True)
class Files:
    """The files of one recording.

    Attributes:
        main: File with the pictures.
        annotations: File with the calibration, and in parts 1 and 2 of the data set masks,
            keypoints and SMPL-X.
        kinect: File with depth, or None if it was not downloaded.
    """

    main: Path
    annotations: Path
    kinect: Path | None


def is_recording(path: Path) -> bool:
    """Whether a path is a main SMC file or a folder that holds one."""
    return path.suffix == ".smc" if os.path.isfile(path) else bool(_mains(path))


def find_files(path: Path) -> Files:
    """Finds the files that belong to one recording.

    Annotations and depth lie beside the main file, or where the data set puts them: in folders
    named like that of the main file, but with "annotations" and "kinect" instead of "main".

    Args:
        path: The main file, or a folder that holds one recording.

    Raises:
        CaptureError: If the folder holds several recordings, or annotations are missing.
    """
    main = _only_main(path)
    annotations = _companion(main, "annotations", ANNOTATIONS)
    if annotations is None:
        raise CaptureError(
            f"{main} lacks its annotations with the calibration: put {main.stem}{ANNOTATIONS}.smc "
            "beside it."
        )
    return Files(main, annotations, _companion(main, "kinect", KINECT))


def _mains(folder: Path) -> list[Path]:
    """Main files in a folder."""
    return [p for p in smc_files(folder) if not p.stem.endswith((ANNOTATIONS, KINECT))]


def _only_main(path: Path) -> Path:
    """The main file that is meant."""
    if os.path.isfile(path):
        if path.stem.endswith((ANNOTATIONS, KINECT)):
            raise CaptureError(f"{path} has no pictures: name the main file instead.")
        return path
    return only_one(path, _mains(path))


def _companion(main: Path, kind: str, suffix: str) -> Path | None:
    """A file that belongs to the main file."""
    name = f"{main.stem}{suffix}.smc"
    folder = main.absolute().parent
    places = [folder, folder.with_name(folder.name.replace("main", kind))]
    return next((place / name for place in places if os.path.isfile(place / name)), None)
