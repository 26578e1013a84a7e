"""Where the joints of a synthetic person were: for measuring, never for training.

Nothing of it lies in a recording; it is acted again from the recording's settings.
"""

import json
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ico3d.errors import CaptureError
from ico3d.studio.acting.embody import embodied
from ico3d.studio.acting.performance import perform
from ico3d.studio.person.choice import load_subject
from ico3d.studio.recording import Recording


@dataclass(frozen=True)
class TrueJoints:
    """Joints of a synthetic person through F frames.

    Attributes:
        names: J names, MakeHuman's.
        places: (F, J, 3) metres in the world.
        turns: (F, J, 3, 3) from rest to the world, of what the joints carry.
        rest: (J, 3) metres, where the person stands at rest.
    """

    names: tuple[str, ...]
    places: np.ndarray
    turns: np.ndarray
    rest: np.ndarray


def true_joints(folder: Path, subject: Path) -> TrueJoints:
    """The joints of the whole person whom a folder shows.

    Args:
        folder: What `ico3d capture synthetic --rig body` wrote.
        subject: The file of the person; the recording knows its name only.

    Raises:
        CaptureError: If the recording does not show a whole person.
    """
    settings = json.loads((folder / "capture.json").read_text())["settings"]
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
