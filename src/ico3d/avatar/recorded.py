"""The recorded motion of a body on a skeleton, and `clips.toml`, which cuts it into gestures."""

import os
from pathlib import Path

from ico3d.avatar.head_joint import rig_of, trained_poses
from ico3d.body.model_folder import TrainedBody
from ico3d.common.files import read_small
from ico3d.errors import SettingsError
from ico3d.motion.recorded.cut import CUTS, Cut, from_toml
from ico3d.motion.recorded.recording import Recording, recording_of


def recording_of_body(body: TrainedBody) -> Recording | None:
    """The motion of a body's trained poses; None without a skeleton that has a person's joints."""
    rig = rig_of(body)
    if rig is None:
        return None
    try:
        return recording_of(rig, body.fps, trained_poses(body)[0])
    except SettingsError:
        return None


def read_cuts(folder: Path, body: TrainedBody) -> tuple[Cut, ...] | None:
    """Reads `clips.toml` of a model's folder; None where there is no such file.

    Raises:
        SettingsError: If the file makes no sense, or belongs to another body.
    """
    file = folder / CUTS
    if not os.path.isfile(file):
        return None
    try:
        content = read_small(file)
    except OSError as error:
        raise SettingsError(f"{file} cannot be read ({error}).") from error
    return from_toml(content, str(file), body.fps, body.windows[-1].last + 1)
