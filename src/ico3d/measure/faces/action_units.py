"""AUE: the error of a face's action units, from two tables that OpenFace wrote."""

import csv
import io
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from ico3d.common.files import read_small
from ico3d.errors import CaptureError

LOWER = ("AU10", "AU12", "AU14", "AU15", "AU17", "AU20", "AU23", "AU25", "AU26")
"""Action units of the lower face among those whose intensity OpenFace estimates."""
UPPER = ("AU01", "AU02", "AU04", "AU05", "AU06", "AU07", "AU09", "AU45")
"""Action units of the upper face among those whose intensity OpenFace estimates."""

MOST_ROWS = 100_000
"""Rows that are read: an hour of video at 25 frames per second has 90,000."""
_FRAME, _SUCCESS = "frame", "success"


@dataclass(frozen=True)
class ActionUnits:
    """Intensities of action units over time.

    Attributes:
        frames: (T,) numbers of the frames, as OpenFace counts them, from 1.
        intensities: (T, 17) from 0 to 5, in the order of `LOWER + UPPER`.
        seen: (T,) bool, whether OpenFace tracked the face in the frame.
    """

    frames: np.ndarray
    intensities: np.ndarray
    seen: np.ndarray


@dataclass(frozen=True)
class ActionUnitError:
    """AUE of two videos of one face.

    Attributes:
        lower: Sum over the units of the lower face (`LOWER`).
        upper: Sum over the units of the upper face (`UPPER`).
        frames: Number of the frames that were compared.
    """

    lower: float
    upper: float
    frames: int


def read_action_units(path: Path) -> ActionUnits:
    """Reads a table that OpenFace's FeatureExtraction wrote (`.csv`, with `-aus`).

    Blanks around names of columns, which most versions of OpenFace write, do not matter. A table
    without a column `success` or `frame` counts as seen throughout, and numbered from 1.

    Raises:
        CaptureError: If the file cannot be read, lacks a unit, or has something that is no number.
    """
    try:
        text = read_small(path).decode("utf-8-sig")
        lines = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
        rows = list(islice((row for row in lines if row), MOST_ROWS + 1))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CaptureError(f"{path} cannot be read as a table of OpenFace: {error}.") from None
    if len(rows) > MOST_ROWS:
        raise CaptureError(f"{path} has more than {MOST_ROWS} rows: cut it into parts.")
    names = [name.strip() for name in rows[0]] if rows else []
    wanted = [f"{unit}_r" for unit in LOWER + UPPER]
    lacking = [name for name in wanted if name not in names]
    if lacking:
        raise CaptureError(f"{path} is no table of OpenFace: it has no column {lacking[0]}.")
    try:
        table = np.array(rows[1:], np.float64)  # (T, columns)
    except ValueError:
        raise CaptureError(f"{path} has a row that is not {len(names)} numbers.") from None
    if table.ndim != 2 or table.shape[1] != len(names):
        raise CaptureError(f"{path} has no rows of {len(names)} numbers.")
    column = {name: table[:, k] for k, name in enumerate(names)}
    count = len(table)
    return ActionUnits(
        column.get(_FRAME, np.arange(1, count + 1)).astype(int),
        np.stack([column[name] for name in wanted], 1),  # (T, 17)
        column.get(_SUCCESS, np.ones(count)) > 0,
    )


def action_unit_error(predicted: ActionUnits, truth: ActionUnits) -> ActionUnitError:
    """AUE: the sum over action units of the mean over time of the squared error of intensity.

    The definition is that of the evaluation of TalkingGaussian (Li et al., ECCV 2024), which
    reports the lower and the upper face apart. Frames are matched by their number; those in which
    either face was not tracked do not count.

    Raises:
        CaptureError: If no frame is in both tables with a tracked face.
    """
    _, a, b = np.intersect1d(
        predicted.frames[predicted.seen], truth.frames[truth.seen], return_indices=True
    )
    if not len(a):
        raise CaptureError("the two tables of OpenFace have no frame with a face in common.")
    difference = predicted.intensities[predicted.seen][a] - truth.intensities[truth.seen][b]
    errors = (difference**2).mean(0)  # (17,)
    lower = len(LOWER)
    return ActionUnitError(float(errors[:lower].sum()), float(errors[lower:].sum()), len(a))
