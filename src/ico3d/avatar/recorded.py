"""What a body on a skeleton did in its recording, and the file that says so."""

from pathlib import Path

from ico3d.avatar.head_joint import rig_of, trained_poses
from ico3d.body.model_folder import TrainedBody
from ico3d.errors import SettingsError
from ico3d.motion.recorded.cut import CUTS, Cut, from_toml
from ico3d.motion.recorded.recording import Recording, recording_of


def recording_of_body(body: TrainedBody) -> Recording | None:
    """How a body moved, in its trained poses; None without a skeleton that has a person's roles."""
    rig = rig_of(body)
    if rig is None:
        return None
    try:
        return recording_of(rig, body.fps, trained_poses(body)[0])
    except SettingsError:
        return None


def read_cuts(folder: Path, body: TrainedBody) -> tuple[Cut, ...] | None:
    """The `clips.toml` of a model's folder; None where nobody put one there.

    Raises:
        SettingsError: If it makes no sense, or is of another body.
    """
    file = folder / CUTS
    if not file.is_file():
        return None
    return from_toml(file.read_bytes(), str(file), body.fps, body.windows[-1].last + 1)
