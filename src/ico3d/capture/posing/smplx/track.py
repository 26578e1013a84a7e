"""Makes a body track of SMPL-X parameters: nothing is fitted, the published equations are used.

SMPL-X's corrections that depend on the pose (`posedirs`) are left out: what plays a body track
mixes the transforms of joints and nothing else, and Gaussians on a skeleton learn for themselves
how the surface departs from that.
"""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.posing.smplx.joints import MARKED, NAMES
from ico3d.capture.posing.smplx.model_file import BodyModel, read_model
from ico3d.capture.posing.tracking import Fitted, between
from ico3d.errors import CaptureError
from ico3d.rig.binding import Binding
from ico3d.rig.body_track import LONGEST, BodyTrack
from ico3d.rig.quaternions import from_matrix, from_rotvec, multiply
from ico3d.rig.rig import Rig

log = logging.getLogger(__name__)
LICENCE = "SMPL-X model licence of the Max Planck Society: non-commercial"
"""What holds for a track that is made with a model file of SMPL-X."""
SMALLEST, TALLEST = 0.3, 3.0
"""Least and greatest height of a body at rest, metres."""


@dataclass(frozen=True, eq=False)
class Person:
    """A person as parameters describe them, before `SmplX.scale` is applied.

    Attributes:
        frames: (F',) indices of the frames with parameters, ascending.
        vertices: (V, 3) surface at rest, metres.
        joints: (55, 3) joints at rest, metres.
        rotations: (F', 55, 4) local rotations in the axes of the capture's world, wxyz.
        moves: (F', 3) translations in the capture's world, metres.
        turn: (3, 3) rotation from the world of the files to the capture's world.
        gender: Variant of the model: "male", "female" or "neutral".
        scale: Scale of the body that the parameters state.
    """

    frames: np.ndarray
    vertices: np.ndarray
    joints: np.ndarray
    rotations: np.ndarray
    moves: np.ndarray
    turn: np.ndarray
    gender: str
    scale: float

    def root(self, scale: float) -> np.ndarray:
        """(F', 3) positions of the root in the world, metres, of a body of this scale."""
        return scale * self.turn @ self.joints[0] + self.moves

    def marked(self, parents: tuple[int, ...], scale: float) -> np.ndarray:
        """(F', N, 3) positions in the world of the joints of `MARKED`, metres."""
        rig = Rig(NAMES, parents, scale * (self.joints - self.joints[0]))
        return rig.posed(self.rotations, self.root(scale))[1][:, list(MARKED.values())]


def track_from_parameters(capture: Capture, file: Path) -> Fitted:
    """The body track of a recording that brings SMPL-X parameters.

    Shape and expression are means over all frames, as a track has one surface. Frames without
    parameters are interpolated.

    Args:
        capture: The recording; at least one frame must have parameters.
        file: The user's model file of SMPL-X.

    Returns:
        The track, with how far joints of arms and legs are from the recording's own key points.

    Raises:
        CaptureError: If the file cannot be read, or file and parameters make no body.
    """
    model = read_model(file)
    person = _person(capture, model)
    known = np.stack([_key_points(capture, frame) for frame in person.frames])  # (F', N, 3)
    scale = _scale(capture, model, person, known)
    floor = np.array([0.0, scale * person.vertices[:, 1].min(), 0.0])
    rest = scale * person.joints - floor
    roots = person.root(scale) - rest[0]
    rotations, roots = between(person.rotations, roots, person.frames, capture.num_frames)
    track = BodyTrack(
        Rig(NAMES, model.parents, rest),
        capture.fps,
        rotations.astype(np.float32),
        roots.astype(np.float32),
        np.isin(np.arange(capture.num_frames), person.frames),
        (scale * person.vertices - floor).astype(np.float32),
        model.faces,
        Binding.strongest(model.weights),
        f"SMPL-X, {person.gender}, posed by the recording's own parameters",
        LICENCE,
    )
    off, outside = np.full((2, capture.num_frames), np.nan)
    off[person.frames] = _medians(person.marked(model.parents, scale) - known)
    return Fitted(track, off, outside)


def _person(capture: Capture, model: BodyModel) -> Person:
    """The person whom a recording's parameters describe.

    Raises:
        CaptureError: If the parameters make no body.
    """
    found = {f: fit for f in range(capture.num_frames) if (fit := capture.smplx(f)) is not None}
    fits = list(found.values())
    betas = np.mean([fit.betas for fit in fits], axis=0)  # (10,)
    expression = np.mean([fit.expression for fit in fits], axis=0)  # (10,)
    turn = fits[0].world_from_fit[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused below
        vertices, joints = model.shaped(betas, expression)
        poses = np.stack([fit.fullpose for fit in fits]) + model.hands  # (F', 55, 3)
        rotations = from_rotvec(poses)  # (F', 55, 4)
        rotations[:, 0] = multiply(from_matrix(turn), rotations[:, 0])
        moves = np.stack([fit.transl for fit in fits]) @ turn.T  # (F', 3)
    scale = fits[0].scale
    tall = scale * float(np.ptp(vertices[:, 1]))
    whole = np.isfinite(rotations).all() and np.abs(vertices).max() < LONGEST
    if not (whole and SMALLEST < tall < TALLEST and np.abs(joints).max() < TALLEST):
        raise CaptureError(
            f"{capture.path}: its SMPL-X parameters and this model make no body ({tall:.3g} m "
            "tall): are both as their makers published them?"
        )
    if not np.abs(moves).max() < LONGEST - TALLEST:
        raise CaptureError(
            f"{capture.path}: its SMPL-X parameters place the body more than {LONGEST:g} m away."
        )
    frames = np.array(list(found))
    return Person(frames, vertices, joints, rotations, moves, turn, fits[0].gender, scale)


def _key_points(capture: Capture, frame: int) -> np.ndarray:
    """(N, 3) the recording's key points at the joints of `MARKED`, metres; NaN where unknown."""
    points = capture.whole_body_points(frame)
    return np.full((len(MARKED), 3), np.nan) if points is None else points[list(MARKED)]


def _scale(capture: Capture, model: BodyModel, person: Person, known: np.ndarray) -> float:
    """The scale of the body: as stated, unless key points `known` (F', N, 3) lie nearer to 1.

    What DNA-Rendering's makers publish to draw their bodies reads the stated scale and does not
    use it; which of the two holds is measured where a recording brings key points.
    """
    stated = person.scale
    if stated == 1 or not np.isfinite(known).any():
        return stated
    away = {
        scale: np.nanmedian(_medians(person.marked(model.parents, scale) - known))
        for scale in (stated, 1.0)
    }
    if away[1.0] >= away[stated]:
        return stated
    log.warning(
        "%s: the stated scale %.4g of the SMPL-X body is not used, as key points lie nearer "
        "without it.",
        capture.path,
        stated,
    )
    return 1.0


def _medians(off: np.ndarray) -> np.ndarray:
    """(F',) median length of the known ones among vectors (F', N, 3); NaN where none is known."""
    lengths = np.linalg.norm(off, axis=-1)  # (F', N)
    found = np.full(len(lengths), np.nan)
    some = np.isfinite(lengths).any(1)
    found[some] = np.nanmedian(lengths[some], axis=1)
    return found
