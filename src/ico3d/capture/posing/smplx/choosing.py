"""Finds the user's SMPL-X model file for the parameters of a recording."""

import os
import re
from pathlib import Path

from rich.console import Console

from ico3d.capture.capture import Capture
from ico3d.common.weights import find_model
from ico3d.errors import MissingModelError, SettingsError


def chosen_model(capture: Capture, named: Path | None) -> Path | None:
    """The SMPL-X model file with which the parameters of a recording are used.

    Where a recording brings parameters and there is no file for them, a line says what is needed.

    Args:
        capture: The recording.
        named: The file that the user names; None for SMPLX_MALE.npz, SMPLX_FEMALE.npz or
            SMPLX_NEUTRAL.npz in the folders of weights, whichever the parameters belong to.

    Returns:
        The file; None where the recording brings no parameters, or no file is there.

    Raises:
        SettingsError: If the user names a file, and the recording brings no parameters, or the
            file's name is that of another sex.
        MissingModelError: If the file that the user names is missing.
    """
    gender = _gender(capture)
    if gender is None:
        if named is not None:
            raise SettingsError(
                f"{capture.path} brings no SMPL-X parameters: without --smplx-model, a body is "
                "fitted to it."
            )
        return None
    name = f"SMPLX_{gender.upper()}.npz"
    if named is None:
        found = find_model(name)
        if found is None:
            _tell(gender, name)
        return found
    if not os.path.isfile(named):
        raise MissingModelError(f"there is no SMPL-X model {named}.")
    of = re.search(r"(?:^|[^a-z])(male|female|neutral)(?:[^a-z]|$)", named.stem.lower())
    if of and of[1] != gender:
        raise SettingsError(
            f"{named} is the {of[1]} SMPL-X model, the parameters of {capture.path} belong to the "
            f"{gender} one: name {name}."
        )
    return named


def _gender(capture: Capture) -> str | None:
    """The variant of the model to which a recording's parameters belong; None without any."""
    for frame in range(capture.num_frames):
        fit = capture.smplx(frame)
        if fit is not None:
            return fit.gender
    return None


def _tell(gender: str, name: str) -> None:
    """Prints what it takes to use a recording's parameters."""
    Console(stderr=True, soft_wrap=True).print(
        f"The recording brings SMPL-X parameters ({gender}). With {name} from smpl-x.is.tue.mpg.de "
        "(licence: non-commercial) in the folder ICO3D_MODELS, or as --smplx-model, they would be "
        "used; a body is fitted instead.",
        highlight=False,
    )
