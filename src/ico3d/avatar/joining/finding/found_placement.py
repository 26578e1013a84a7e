"""Where a head without landmarks belongs on a body: by pictures of both."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar.avatar import Placement
from ico3d.avatar.joining.cropping import cropped
from ico3d.avatar.joining.driving import head_poses
from ico3d.avatar.joining.finding.found_face import FaceSeeker, FoundFace, face_seeker
from ico3d.avatar.joining.region import HeadRegion
from ico3d.avatar.joining.similarity import canonical_from_head, fit_in_words
from ico3d.capture.capture import Capture
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians
from ico3d.splat.render import render


class OverRecording(Capture):
    """A recording in which a head is drawn over that of the person."""

    kind = "drawn over"

    def __init__(self, capture: Capture, gaussians: Gaussians, placement: Placement):
        """Puts a head into a recording.

        Args:
            capture: The recording of the whole person.
            gaussians: The head in its own space.
            placement: Where it is.
        """
        self.path, self.cameras, self.split = capture.path, capture.cameras, capture.split
        self.fps, self.num_frames = capture.fps, capture.num_frames
        self._capture, self._gaussians, self._placement = capture, gaussians, placement

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The picture (H, W, 3) with the head in it, or None where there is none."""
        image = self._capture.image(camera, frame)
        if image is None:
            return None
        there = self._gaussians.transform(self._placement.world_from_head(frame))
        with torch.no_grad():
            behind = torch.from_numpy(image).to(there.means.device)
            drawn = render(there, [self.cameras[camera]], behind)
        return drawn.rgb[0].clamp(0, 1).cpu().numpy()

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The recorded person."""
        return self._capture.mask(camera, frame)


def found_in_pictures(
    head: TrainedHead,
    capture: Capture,
    folder: Path,
    say: Callable[[str], None],
    device: torch.device,
) -> tuple[TrainedHead, Placement | None]:
    """Finds the face of a head in pictures drawn of it, and puts it where the body's is found.

    Args:
        head: Whose capture had no landmarks.
        capture: The body's recording.
        folder: The head's, for messages.
        say: Told how well the pictures agree.
        device: Where the head is drawn.

    Returns:
        The head with landmarks, and where it is; None where no pictures of the body show its face
        well enough.

    Raises:
        CaptureError: If the capture has no head poses, or the face does not follow them.
        MissingExtraError: If MediaPipe is not installed.
        MissingModelError: If the face model is not there.
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
    """A better placement: what the tracker errs by in these very pictures, small or askew, cancels.

    The head is drawn into the recorded pictures and its face found there as the person's was. What
    lies between the two corrects the placement.

    Returns:
        G and how well landmarks agree, as of `canonical_from_head`; None where the drawn head's
        face is not found at the same moments.
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
    """Where the face comes from, and how well views agree."""
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
