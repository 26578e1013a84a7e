"""Poses of frames that a body was not trained on, fitted to their pictures.

A body track comes from key points and outlines, which leave centimetres. A trained body's Gaussians
know what the person looks like: held as they are, they tell where each limb is in a picture.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from ico3d.body.model_folder import TrainedBody
from ico3d.body.settings import Loss
from ico3d.body.skinning.skinned import Skinned
from ico3d.body.training.views import BodyViews
from ico3d.capture.capture import Capture
from ico3d.capture.pictures import View
from ico3d.errors import SettingsError
from ico3d.rig.body_track import BodyTrack
from ico3d.rig.quaternions import normalized
from ico3d.splat.losses import l1, photometric
from ico3d.splat.render import render
from ico3d.training.optimiser import Optimiser
from ico3d.training.rate import Rate

STEPS = 96
"""Pictures that fit each frame's pose, one after the other."""
RATE = Rate(2e-3, 0.1)
"""Of rotations, as quaternions, and of the root, metres."""
CACHE_GIB = 1.0
"""Memory for pictures."""


def fitted_poses(
    body: TrainedBody, capture: Capture, track: BodyTrack, frames: Sequence[int]
) -> BodyTrack:
    """A track whose poses in some frames show the body as the training cameras saw the person.

    Test cameras are not looked at. The poses are for this body, which has its own joints at rest.

    Args:
        body: On a skeleton; it does not change.
        capture: The recording, with masks.
        track: Where the poses begin; its rig is the body's.
        frames: Whose poses are fitted; one that no camera shows keeps its pose.

    Raises:
        SettingsError: If the body hangs on no skeleton.
        CaptureError: If no picture shows the person in these frames.
    """
    model = body.models[-1]
    if not isinstance(model.motion, Skinned):
        raise SettingsError("poses can only be fitted to a body on a skeleton (--method skinned).")
    values = {name: t.detach() for name, t in {**model.gaussians, **model.shared}.items()}
    pictures = BodyViews(capture, frames, CACHE_GIB)
    rotations, roots = track.rotations.copy(), track.roots.copy()
    for frame in frames:
        views = [view for view in pictures.views if view.frame == frame]
        if views:
            begun = {
                "rotations": torch.from_numpy(rotations[frame].copy()).to(model.device),
                "root": torch.from_numpy(roots[frame].copy()).to(model.device),
            }
            turned, root = _fitted(model.motion, values, begun, pictures, views)
            rotations[frame] = normalized(turned.double().cpu().numpy())
            roots[frame] = root.cpu().numpy()
    return replace(track, rotations=rotations, roots=roots)


def _fitted(
    motion: Skinned,
    values: Mapping[str, Tensor],
    pose: Mapping[str, Tensor],
    pictures: BodyViews,
    views: Sequence[View],
) -> tuple[Tensor, Tensor]:
    """Rotations (J, 4) and root (3,) of one frame, changed in place by `STEPS` of its views."""
    rng, weights, optimiser = np.random.default_rng(views[0].frame), Loss(), Optimiser()
    order = np.concatenate([rng.permutation(len(views)) for _ in range(-(-STEPS // len(views)))])
    for step, which in enumerate(order[:STEPS]):
        for part in pose.values():
            part.requires_grad_().grad = None
        view = views[which]
        example = pictures.example(view, rng.random(3), pose["root"].device)
        seen = render(motion.posed(values, **pose), [view.camera], example.color)
        target = example.target[None]  # (1, H, W, 3)
        loss = photometric(seen.rgb, target, l1_weight=1 - weights.ssim, ssim_weight=weights.ssim)
        (loss + weights.mask * l1(seen.alpha[0], example.mask)).backward()
        for name, part in pose.items():
            assert part.grad is not None  # the body is in the picture
            optimiser.update(name, part, part.grad, RATE.at(step / STEPS))
    return pose["rotations"].detach(), pose["root"].detach()
