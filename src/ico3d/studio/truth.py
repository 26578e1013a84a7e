"""True positions of a synthetic person's joints: for measuring, never for training.

Recordings do not contain these positions; they are recomputed from the recording's settings.
"""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ico3d.common.files import read_object
from ico3d.errors import CaptureError
from ico3d.studio.acting.embody import embodied
from ico3d.studio.acting.performance import perform
from ico3d.studio.person.choice import load_subject
from ico3d.studio.recording import Recording


@dataclass(frozen=True)
class TrueJoints:
    """Positions of J joints of a synthetic person in F frames.

    Attributes:
        names: Names of the joints in MakeHuman's default rig.
        places: (F, J, 3) positions in the world, metres.
        turns: (F, J, 3, 3) rotations from rest to the world, of what the joints carry.
        rest: (J, 3) positions at rest, metres.
    """

    names: tuple[str, ...]
    places: np.ndarray
    turns: np.ndarray
    rest: np.ndarray


def true_joints(folder: Path, subject: Path) -> TrueJoints:
    """The joints of the whole person in a synthetic recording.

    Args:
        folder: Folder that `ico3d capture synthetic --rig body` wrote.
        subject: The person's file, of which the recording stores only the name.

    Raises:
        CaptureError: If the folder holds no synthetic recording, or not of a whole person.
    """
    file = folder / "capture.json"
    settings = read_object(file).get("settings")
    if settings is None:
        raise CaptureError(f"{folder} is no recording that ico3d capture synthetic made.")
    known = [field.name for field in fields(Recording) if field.name in settings]
    recording = Recording(**{name: settings[name] for name in known})  # older ones know fewer
    person = load_subject(str(subject), recording.whole)
    if person.skeleton is None:
        raise CaptureError(f"{folder} does not show a whole person.")
    acted = perform(
        person, recording.text, recording.frames, recording.fps, recording.seed, recording.lively
    )
    acted = embodied(
        person, acted, recording.motion, recording.fps, recording.seed, recording.arms_clear
    )
    at = np.append(person.skeleton.at, np.ones((len(person.skeleton.at), 1)), 1)  # (J, 4)
    assert acted.joints is not None  # embodied
    places = np.einsum("fjab,jb->fja", acted.joints, at)[..., :3]  # (F, J, 3)
    rest = person.skeleton.at + person.head_in_world
    return TrueJoints(person.skeleton.names, places, acted.joints[..., :3, :3], rest)
