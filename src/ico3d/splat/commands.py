"""The verb `ico3d convert`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from ico3d.errors import printable


@dataclass(frozen=True)
class Convert:
    """Converts a file of 3D Gaussians: reads PLY, compressed PLY, SPZ, .splat; writes PLY or SPZ.

    Attributes:
        source: The file to read; its format is recognised by its contents.
        target: The file to write: .ply (lossless) or .spz (about a fifth of the size).
        sh_degree: Drop the spherical harmonics above this degree; by default all are kept.
    """

    source: tyro.conf.Positional[Path]
    target: tyro.conf.Positional[Path]
    sh_degree: Literal[0, 1, 2, 3] | None = None

    def run(self) -> None:
        """Converts the file and prints what was read and written."""
        from ico3d.splat.files.formats import read_file, write_gaussians

        read = read_file(self.source)
        gaussians = read.gaussians
        if self.sh_degree is not None:
            gaussians = gaussians.with_degree(self.sh_degree)
        print(_line(self.source, read.kind, len(gaussians), read.gaussians.degree))
        write_gaussians(self.target, gaussians)
        kind = self.target.suffix[1:].upper()
        print(_line(self.target, kind, len(gaussians), gaussians.degree))


def _line(path: Path, kind: str, count: int, degree: int) -> str:
    """What a file of Gaussians holds, in one line."""
    size = path.stat().st_size
    told = f"{path}: {kind}, {count:,} Gaussians, SH degree {degree}, {size:,} bytes"
    return printable(told)
