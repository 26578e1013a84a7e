"""Tracks a head through a recording by several cameras."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.capture.face.expressions import BLENDSHAPES, eyes_of_blendshapes
from ico3d.capture.face.landmarks import MULTI_PIE
from ico3d.capture.face.mediapipe_face import canonical_face
from ico3d.capture.formats import open_capture, opened_apart
from ico3d.capture.headpose.shape import inverse, moved, rigid_head
from ico3d.capture.headpose.smoothing import filled, filled_poses, smoothed_poses
from ico3d.capture.headpose.track_file import HeadTrack
from ico3d.capture.headtrack.faces import Finder, Head, finder
from ico3d.capture.multiview.writing import shown
from ico3d.capture.portrait.picture_poses import rigid_landmarks
from ico3d.common.weights import model_file
from ico3d.errors import CaptureError

PURPOSE = "tracking a head"
SIZES = (0.6, 1.6)
"""Smallest and largest head, as a factor of the canonical face; children are included."""


@dataclass(frozen=True)
class Report:
    """Quality of a track.

    Attributes:
        num_frames: Number of frames of the recording.
        tracked: Number of frames that were measured.
        reprojection: Mean distance in pixels between the track's landmarks and those seen.
        views: Mean number of cameras that were used for a tracked frame.
        gaps: First and last frame of each run of frames that were interpolated.
    """

    num_frames: int
    tracked: int
    reprojection: float
    views: float
    gaps: list[tuple[int, int]]


def track_head(source: Path, workers: int) -> tuple[HeadTrack, Report]:
    """Tracks the head of one person.

    Args:
        source: A capture by several calibrated cameras, of any format.
        workers: Number of threads.

    Returns:
        The track and its quality.

    Raises:
        CaptureError: If no two cameras agree on a face in any frame, or the size of the head is not
            human.
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If MediaPipe's face model is not installed.
    """
    model = model_file("face_landmarker.task", PURPOSE)
    canonical = canonical_face(model)
    whole = open_capture(source)
    with finder(lambda: opened_apart(whole), canonical, model, workers) as found:
        capture, heads, last = found.capture, {}, None
        with shown("finding the head", capture.num_frames) as advance:
            for frame in range(capture.num_frames):
                last = found.find(frame, last)
                if last is not None:
                    heads[frame] = last
                advance()
    if not heads:
        raise CaptureError(f"{source}: {_nothing(found)}.")
    track = assemble(capture, heads, canonical.vertices)
    return track, report(capture, heads, track)


def _nothing(found: Finder) -> str:
    """Why no head was found, and what to do."""
    if found.disagreements:
        return (
            "cameras show faces, but no two agree on where one is; are the calibration and its "
            "scale (metres) right, and do the cameras run in step?"
        )
    return (
        "no frame shows a face to two cameras at least; a head is tracked where two cameras "
        "before the person see the face, 20 pixels high and more"
    )


def assemble(capture: Capture, heads: dict[int, Head], canonical: np.ndarray) -> HeadTrack:
    """Combines the heads of single frames to one rigid head in motion.

    Args:
        capture: The recording.
        heads: Heads by frame.
        canonical: (468, 3) vertices of the canonical face, metres.

    Raises:
        CaptureError: If the head is so large or small that the world's unit cannot be metres.
    """
    frames, count = np.array(sorted(heads)), capture.num_frames
    points = np.stack([heads[frame].points for frame in frames])  # (K, 468, 3)
    rigid = rigid_head(points, canonical, rigid_landmarks(canonical))
    _check_size(capture, rigid.shape, canonical)
    # In the space of each frame's own pose landmarks are free of what that pose errs by.
    marks = moved(inverse(rigid.poses), points)[:, MULTI_PIE]  # (K, 68, 3)
    shapes = np.stack(
        [heads[f].faces[heads[f].most_frontal(capture)].blendshapes for f in frames]
    )  # (K, 52)
    views = np.zeros((count, len(capture.cameras)), np.uint8)
    for frame in frames:
        views[frame, list(heads[frame].faces)] = 1
    every = filled(shapes, frames, count).astype(np.float32)
    return HeadTrack(
        smoothed_poses(filled_poses(rigid.poses, frames, count), capture.fps),
        filled(marks, frames, count).astype(np.float32),
        eyes_of_blendshapes(every, BLENDSHAPES),
        every,
        views,
    )


def _check_size(capture: Capture, shape: np.ndarray, canonical: np.ndarray) -> None:
    """Whether a head is of a size that heads have."""
    size = float(np.linalg.norm(np.ptp(shape, axis=0)) / np.linalg.norm(np.ptp(canonical, axis=0)))
    if not SIZES[0] < size < SIZES[1]:
        raise CaptureError(
            f"{capture.path}: the head is {size:.2g} times as large as usual, so the cameras are "
            "not in metres; import the recording again with --scale."
        )


def report(capture: Capture, heads: dict[int, Head], track: HeadTrack) -> Report:
    """Compares a track with the faces that the cameras show."""
    errors = []
    for frame, head in heads.items():
        places = moved(track.world_from_head[frame][None], track.landmarks[frame])[0]
        for camera, face in head.faces.items():
            pixels = capture.cameras[camera].project(places)[0]
            away = np.linalg.norm(pixels - face.landmarks[MULTI_PIE], axis=1)
            errors.append(away.mean())
    return Report(
        capture.num_frames,
        len(heads),
        float(np.mean(errors)),
        len(errors) / len(heads),
        track.gaps,
    )
