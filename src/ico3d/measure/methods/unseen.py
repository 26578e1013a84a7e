"""Bodies in frames that they were not trained on."""

import torch

from ico3d.body.model_folder import TrainedBody
from ico3d.body.skinning.skinned import Skinned
from ico3d.capture.capture import Capture
from ico3d.measure.body import evaluate_body
from ico3d.rig.body_track import BodyTrack
from ico3d.splat.gaussians import Gaussians

SCORES = ("psnr_mask", "psnr_moving")


class Reposed:
    """A body in the poses of a track that goes on where its own clip ends.

    A body without a skeleton stays as it was in its last frame.
    """

    def __init__(self, body: TrainedBody, track: BodyTrack | None):
        """Binds a body to a track of the whole recording."""
        self._body, self._track = body, track

    def gaussians(self, seconds: float) -> Gaussians:
        """Activated Gaussians in the world at a time."""
        model = self._body.models[-1]
        if self._track is None or not isinstance(model.motion, Skinned):
            return self._body.gaussians(seconds)
        frame = round(seconds * self._track.fps)
        pose = (self._track.rotations[frame], self._track.roots[frame])
        rotations, root = (torch.from_numpy(part).to(model.device) for part in pose)
        return model.motion.posed({**model.gaussians, **model.shared}, rotations, root)


def unseen_scores(body: TrainedBody, capture: Capture, first: int) -> dict[str, float | None]:
    """`SCORES` of the frames from `first` on, in the poses that were tracked there.

    Args:
        body: Trained on the frames before.
        capture: The whole recording.
        first: Number of the first frame that was not trained on.
    """
    frames = range(first, capture.num_frames)
    reposed = Reposed(body, capture.body_track())
    found = evaluate_body(body, capture, frames=frames, drawn=reposed)
    return {f"unseen_{name}": found[name] for name in SCORES}
