"""Measures bodies in frames on which they were not trained."""

import torch

from ico3d.body.model_folder import TrainedBody
from ico3d.body.reposing.fit_poses import fitted_poses
from ico3d.body.skinning.skinned import Skinned
from ico3d.capture.capture import Capture
from ico3d.measure.body import evaluate_body
from ico3d.rig.body_track import BodyTrack
from ico3d.splat.gaussians import Gaussians

SCORES = ("psnr_mask", "psnr_moving")


class Reposed:
    """A body on a skeleton in the poses of a body track, also after the end of the body's clip.

    A body without a skeleton, or without a track, stays as it is in its last frame.
    """

    def __init__(self, body: TrainedBody, track: BodyTrack | None):
        """Makes a body that follows a track.

        Args:
            body: The trained body.
            track: Body track of the whole recording; None where it has none.
        """
        self._body, self._track = body, track

    def gaussians(self, seconds: float) -> Gaussians:
        """Activated Gaussians in the world at a time in seconds."""
        model = self._body.models[-1]
        if self._track is None or not isinstance(model.motion, Skinned):
            return self._body.gaussians(seconds)
        frame = round(seconds * self._track.fps)
        pose = (self._track.rotations[frame], self._track.roots[frame])
        rotations, root = (torch.from_numpy(part).to(model.device) for part in pose)
        return model.motion.posed({**model.gaussians, **model.shared}, rotations, root)


def unseen_scores(body: TrainedBody, capture: Capture, first: int) -> dict[str, float | None]:
    """Metrics of the frames from `first` on, with the body in the poses that were tracked there.

    Of a body on a skeleton also `unseen_fitted_…`: the same in poses that the training cameras'
    pictures of these frames correct (`ico3d.body.reposing.fit_poses`).

    Args:
        body: Body that was trained on the frames before.
        capture: The whole recording.
        first: Index of the first frame on which the body was not trained.

    Returns:
        The metrics of `SCORES`, each with the prefix `unseen_`.
    """
    frames, track = range(first, capture.num_frames), capture.body_track()
    found = _scores(body, capture, frames, track, "unseen")
    if track is not None and isinstance(body.models[-1].motion, Skinned):
        fitted = fitted_poses(body, capture, track, frames)
        found |= _scores(body, capture, frames, fitted, "unseen_fitted")
    return found


def _scores(
    body: TrainedBody, capture: Capture, frames: range, track: BodyTrack | None, named: str
) -> dict[str, float | None]:
    found = evaluate_body(body, capture, frames=frames, drawn=Reposed(body, track))
    return {f"{named}_{name}": found[name] for name in SCORES}
