"""Measures part by part, and makes a report of it."""

import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from full_size.parts import Measured, Parts, Sizes
from full_size.recordings import write_random_vgg
from ico3d.common.device import DeviceName
from ico3d.common.weights import find_model
from ico3d.errors import CaptureError
from ico3d.head.perceptual import WEIGHTS
from ico3d.protocols.facts import facts_of
from ico3d.protocols.report import Column, Report, Section, Table
from ico3d.splat.device import computing_device, cuda_fault

TITLE = "The paper at its own size"
FAULT = Column("fault", "failed")
MODELS = "ICO3D_MODELS"


def measure(
    out: Path, parts: Sequence[str], sizes: Sizes, wanted: DeviceName
) -> tuple[Report, bool]:
    """Measures and writes a report.

    Args:
        out: Folder of the report, recordings and trainings.
        parts: Names of what to measure.
        sizes: How much.
        wanted: Where to compute.

    Returns:
        The report, and whether anything failed or the backends differ too much.

    Raises:
        CaptureError: If the folder is not empty.
        SettingsError: If CUDA is wanted and does not work.
    """
    if out.exists() and any(out.iterdir()):
        raise CaptureError(f"{out} is not empty: name a new folder.")
    out.mkdir(parents=True, exist_ok=True)
    device = computing_device(wanted)
    known: dict[str, object] = {"command": " ".join(["python", *sys.argv]), "sizes": asdict(sizes)}
    if device.type == "cpu":
        known["no CUDA"] = cuda_fault()
    facts, measure_part = facts_of(device, **known), Parts(out, sizes, device, _weights(out))
    report, measured = Report(TITLE, facts, ()), {}
    for name in parts:
        measured[name] = getattr(measure_part, name)()
        rows = {name: part.rows for name, part in measured.items()}
        report = Report(TITLE, facts, [_section(part) for part in measured.values()], rows)
        report.write(out)  # what is measured stays, whatever becomes of the rest
    every = [row for part in measured.values() for row in part.rows]
    return report, any("fault" in row or row.get("kept") == "no" for row in every)


def _weights(out: Path) -> str | None:
    """A folder of random weights of VGG, used from now on; None where real ones are installed."""
    if find_model(WEIGHTS) is not None:
        return None
    os.environ[MODELS] = str(out / "models")
    write_random_vgg(out / "models")
    return os.environ[MODELS]


def _section(part: Measured) -> Section:
    """A part with a column of faults if there are any."""
    faults = (FAULT,) if any("fault" in row for row in part.rows) else ()
    return Section(part.title, part.text, Table((*part.columns, *faults), part.rows))
