"""The true skeleton of a synthetic person, as a motion-capture suit would tell it.

Recordings do not contain it; it is recomputed from the recording's settings.
"""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ico3d.common.files import read_object
from ico3d.errors import CaptureError
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import continuous, from_matrix
from ico3d.rig.rig import Rig
from ico3d.studio.acting.embody import embodied
from ico3d.studio.acting.performance import perform
from ico3d.studio.choice import load_subject
from ico3d.studio.person.subject import GARMENTS, Material, Subject
from ico3d.studio.recording import Recording

SURFACES = (Material.SKIN, Material.HAIR, *GARMENTS)
"""What a body's surface is made of: nothing within the mouth or before the eyes."""


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
    recording, person = _recorded(folder, subject)
    return _joints(recording, person)


def true_track(folder: Path, subject: Path) -> BodyTrack:
    """Skeleton, motion and clothed surface of the whole person in a synthetic recording.

    Args:
        folder: Folder that `ico3d capture synthetic --rig body` wrote.
        subject: The person's file, of which the recording stores only the name.

    Raises:
        CaptureError: If the folder holds no synthetic recording, or not of a whole person.
    """
    recording, person = _recorded(folder, subject)
    true, skeleton = _joints(recording, person), person.skeleton
    assert skeleton is not None  # _recorded
    parents = skeleton.parents
    local = true.turns.copy()  # (F, J, 3, 3)
    below = np.flatnonzero(parents >= 0)
    local[:, below] = np.swapaxes(true.turns[:, parents[below]], -1, -2) @ true.turns[:, below]
    shown = np.isin(person.materials, SURFACES)
    used, faces = np.unique(person.faces[shown], return_inverse=True)  # (V,), (T, 3)
    return BodyTrack(
        rig=Rig(true.names, tuple(map(int, parents)), true.rest),
        fps=recording.fps,
        rotations=continuous(from_matrix(local)).astype(np.float32),
        roots=(true.places[:, 0] - true.rest[0]).astype(np.float32),
        fitted=np.ones(recording.frames, bool),
        vertices=(person.vertices[used] + person.head_in_world).astype(np.float32),
        faces=faces.reshape(-1, 3).astype(np.int32),
        binding=Binding.strongest(skeleton.weights[used]),
        source=f"{person.name}, as the studio moved the skeleton",
    )


def _recorded(folder: Path, subject: Path) -> tuple[Recording, Subject]:
    """The settings of a synthetic recording, and the whole person in it.

    Raises:
        CaptureError: If the folder holds no synthetic recording, or not of a whole person.
    """
    settings = read_object(folder / "capture.json").get("settings")
    if settings is None:
        raise CaptureError(f"{folder} is no recording that ico3d capture synthetic made.")
    known = [field.name for field in fields(Recording) if field.name in settings]
    recording = Recording(**{name: settings[name] for name in known})  # older ones know fewer
    person = load_subject(str(subject), recording.whole)
    if person.skeleton is None:
        raise CaptureError(f"{folder} does not show a whole person.")
    return recording, person


def _joints(recording: Recording, person: Subject) -> TrueJoints:
    acted = perform(
        person, recording.text, recording.frames, recording.fps, recording.seed, recording.lively
    )
    acted = embodied(
        person, acted, recording.motion, recording.fps, recording.seed, recording.arms_clear
    )
    assert person.skeleton is not None and acted.joints is not None  # whole, and embodied
    at = np.append(person.skeleton.at, np.ones((len(person.skeleton.at), 1)), 1)  # (J, 4)
    places = np.einsum("fjab,jb->fja", acted.joints, at)[..., :3]  # (F, J, 3)
    rest = person.skeleton.at + person.head_in_world
    return TrueJoints(person.skeleton.names, places, acted.joints[..., :3, :3], rest)
