"""Bakes a trained body on a skeleton into the parts of a bundle that browsers play."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from ico3d.avatar import staging
from ico3d.avatar.baked_body import SkinnedBody
from ico3d.avatar.baking import body_cost, head_cost
from ico3d.avatar.baking.body_bundle import BodyParts, seen_box
from ico3d.avatar.baking.importance import gaussian_importance
from ico3d.avatar.baking.skinned.hands import evened
from ico3d.avatar.baking.skinned.quantised import Clip, quantised
from ico3d.avatar.clip_views import recorded_views
from ico3d.avatar.moving import MOMENTS
from ico3d.avatar.poseable import poseable_of
from ico3d.body.model_folder import TrainedBody
from ico3d.body.skinning.skinned import Skinned
from ico3d.bundle.manifest import Loss
from ico3d.bundle.skinned.baked import BakedSkinned
from ico3d.bundle.skinned.gestures import gesture_files
from ico3d.bundle.skinned.info import SKINNED
from ico3d.capture.capture import Capture
from ico3d.errors import BundleError
from ico3d.motion.recorded.cut import Cut
from ico3d.splat.gaussians import Gaussians

PROBES = 24
"""Pictures of the whole person from which the importance of Gaussians is estimated."""
UPPER = 0.45
"""Share of the person's height that as many more pictures show: what pages show at first."""
NEAR = 8
"""Cameras around that share, each of which also sees somebody who stands still, as in pages."""


@dataclass(frozen=True)
class SkinnedResult:
    """A baked body on a skeleton, its file, and what it costs.

    Attributes:
        baked: The baked body.
        data: Content of the body's file.
        loss: Loss of baking, means over pictures.
        cuts: Gestures in the body's recording; None finds them by rule.
    """

    baked: BakedSkinned
    data: bytes
    loss: Loss
    cuts: Sequence[Cut] | None = None

    @property
    def parts(self) -> BodyParts:
        """The parts of a bundle: the body's file, its gestures, and the manifest's entry."""
        files = {SKINNED: self.data, **gesture_files(self.baked, self.cuts)}
        return BodyParts(SkinnedBody(self.baked), files, self.baked.info, self.loss)

    def __str__(self) -> str:
        """One line for people."""
        info = self.baked.info
        return (
            f"{info.num_gaussians} Gaussians on {info.num_joints} joints, {info.num_shapes} "
            f"shapes, {info.num_frames} poses of {info.num_moving} joints: "
            f"{head_cost.in_words(self.loss)}, {len(self.data) / 1e6:.2f} MB, "
            f"{len(self.data) / info.num_gaussians:.1f} bytes per Gaussian"
        )


def is_skinned(body: TrainedBody) -> bool:
    """Whether a trained body is on a skeleton, not of windows."""
    return isinstance(body.models[0].motion, Skinned)


def bake(
    body: TrainedBody,
    capture: Capture | None,
    head: body_cost.HeadAt | None = None,
    cuts: Sequence[Cut] | None = None,
) -> SkinnedResult:
    """Bakes a body on a skeleton.

    Args:
        body: The exact body, which is one window.
        capture: The body's recording, to measure with; None measures against the exact body only.
        head: Returns the exact head on the body, which recorded pictures show as well; None where
            there is no head.
        cuts: Gestures in the recording; None finds them by rule.
    """
    exact = partial(body.window_gaussians, 0)
    with torch.no_grad():
        low, high = seen_box(exact, np.linspace(0, 1, MOMENTS).tolist())
    ring, span = body_cost.ring_of_cameras(low, high), body.windows[0]
    waist = np.array([low[0], high[1] - UPPER * (high[1] - low[1]), low[2]])
    near = body_cost.ring_of_cameras(waist, high, NEAR)
    views = [v for cameras in (ring, near) for v in body_cost.probe_views(cameras, span, PROBES)]
    poses = [(exact(view.tau), view.camera) for view in views]
    poses += [(drawn, camera) for drawn in _at_rest(body) for camera in near]
    importance = gaussian_importance(poses, views[0].background, 0)
    clip = Clip(body.fps, staging.triple(low), staging.triple(high))
    baked = quantised(body.models[0], clip, importance)
    recorded = recorded_views(capture, span) if capture else []
    pair = body_cost.window_pair(body, 0, partial(SkinnedBody(baked).window_gaussians, 0), head)
    probes = body_cost.probe_views(ring, span)
    loss = body_cost.measure(*pair, recorded, probes)
    shown = evened(baked)  # not before: the loss is that of fewer bits
    return SkinnedResult(shown, shown.to_bytes(), loss, cuts)


def _at_rest(body: TrainedBody) -> list[Gaussians]:
    """The person with hanging arms, once; none whose skeleton is not that of a person."""
    person = poseable_of(body, None)
    if person is None:
        return []
    living = person.living
    place = person.footing.place(living.person.retarget.pose(living.hung), np.zeros(3))
    with torch.no_grad():
        return [person.body(*place)]


def check(result: SkinnedResult) -> None:
    """Refuses a result that loses too much.

    Raises:
        BundleError: If the loss breaks a bound; the sentence says what was measured.
    """
    if not body_cost.loses_at_most(result.loss, body_cost.MAX_DROP):
        raise BundleError(
            f"baking the body costs too much ({result}; allowed are {body_cost.MAX_DROP} dB lost, "
            f"{body_cost.MIN_LIKENESS} dB against exact where there is no capture): train it "
            "longer, or use --force."
        )
