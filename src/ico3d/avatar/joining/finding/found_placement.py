"""Places a head that has no landmarks on a body, by finding the face in pictures of both."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.cropping import cropped
from ico3d.avatar.joining.driving import head_poses
from ico3d.avatar.joining.finding.found_face import FaceSeeker, FoundFace, face_seeker
from ico3d.avatar.joining.similarity import canonical_from_head, fit_in_words
from ico3d.capture.capture import Capture
from ico3d.capture.face.region import HeadRegion
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render


class OverRecording(Capture):
    """A recording of a person with a head model drawn over the person's head."""

    kind = "drawn over"

    def __init__(self, capture: Capture, gaussians: Gaussians, placement: Placement):
        """Puts a head into a recording.

        Args:
            capture: The recording of the whole person.
            gaussians: The head in the space of its model.
            placement: Where the head is in each frame.
        """
        self.path, self.cameras, self.split = capture.path, capture.cameras, capture.split
        self.fps, self.num_frames = capture.fps, capture.num_frames
        self._capture, self._gaussians, self._placement = capture, gaussians, placement

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The recorded picture (H, W, 3) with the head drawn over it; None where none exists."""
        image = self._capture.image(camera, frame)
        if image is None:
            return None
        there = self._gaussians.transform(self._placement.world_from_head(frame))
        with torch.no_grad():
            behind = torch.from_numpy(image).to(there.means.device)
            drawn = render(there, [self.cameras[camera]], behind)
        return drawn.rgb[0].clamp(0, 1).cpu().numpy()

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The recorded mask (H, W) of the person; None where there is none."""
        return self._capture.mask(camera, frame)


def found_in_pictures(
    head: TrainedHead,
    capture: Capture,
    folder: Path,
    say: Callable[[str], None],
    device: torch.device,
) -> tuple[TrainedHead, Placement | None]:
    """Finds the faces of a head and of a body in pictures, and places the head accordingly.

    Args:
        head: A head without landmarks.
        capture: The body's recording.
        folder: Folder of the head, for messages.
        say: Called with how well the pictures agree.
        device: Where the head is drawn.

    Returns:
        The head with landmarks, and its placement; None as placement if the body's pictures do not
        show the face well enough.

    Raises:
        CaptureError: If the capture has no head poses, or the face does not move as they do.
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the face landmarker's file is not there.
        ModelError: If the head shows no face, or views of it do not agree.
    """
    poses = head_poses(capture)
    with torch.no_grad(), face_seeker() as seeker:
        neutral = torch.from_numpy(head.neutral())
        drawn = seeker.of_head(head.model(neutral).to(device), folder)
        recorded = seeker.of_body(capture, poses)
        known = replace(head, landmarks=drawn.landmarks)
        say(_in_words(drawn, recorded))
        if recorded is None:
            return known, None
        matrix, rest = canonical_from_head(recorded.landmarks, drawn.landmarks)
        shown = cropped(known, HeadRegion.around(drawn.landmarks)).model(neutral).to(device)
        first = Placement(matrix, poses)
        matrix, rest = _compared(seeker, capture, recorded, shown, first) or (matrix, rest)
    say(fit_in_words(matrix, rest))
    return known, Placement(matrix, poses)


def _compared(
    seeker: FaceSeeker, capture: Capture, recorded: FoundFace, head: Gaussians, first: Placement
) -> tuple[np.ndarray, float] | None:
    """Corrects a placement by finding the face of the placed head in the recorded pictures.

    The head is drawn over the person in these pictures and its face is found as the person's was:
    the difference corrects the placement. The tracker's errors in pictures that are small or not
    from in front are in both, and cancel.

    Args:
        seeker: Finds faces.
        capture: The body's recording.
        recorded: The person's face in this recording.
        head: The cropped head in the space of its model.
        first: The placement to correct.

    Returns:
        The corrected G and how well landmarks agree, as from `canonical_from_head`; None where the
        drawn head's face is not found in frames in which the person's was.
    """
    over = OverRecording(capture, head, first)
    again = seeker.of_body(over, first.world_from_canonical)
    moments = [] if again is None else sorted(again.marks.keys() & recorded.marks.keys())
    if again is None or not moments:
        return None
    source = np.median([again.marks[moment] for moment in moments], axis=0)  # (68, 3)
    between = [recorded.marks[moment] - again.marks[moment] for moment in moments]
    correction, rest = canonical_from_head(source + np.median(between, axis=0), source)
    return correction @ first.canonical_from_head, rest


def _in_words(drawn: FoundFace, recorded: FoundFace | None) -> str:
    """A sentence for people: where faces were found, and how well views agree."""
    theirs = (
        "the pictures of the body do not show it well enough: its recording's landmarks stand in"
        if recorded is None
        else f"the body's in {recorded.views} pictures of {len(recorded.marks)} moments, within "
        f"{1e3 * recorded.apart:.1f} mm"
    )
    return (
        f"face: the head has no landmarks; found in {drawn.views} of {drawn.looks} views drawn of "
        f"it, which agree within {1e3 * drawn.apart:.1f} mm; {theirs}."
    )
