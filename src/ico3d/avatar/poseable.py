"""People on a skeleton, trained or baked, in poses that nobody recorded."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import torch

from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.baked_body import skinned_gaussians
from ico3d.avatar.head_joint import rig_of, trained_poses
from ico3d.avatar.render_bundle import baked_gaussians
from ico3d.body.model_folder import TrainedBody
from ico3d.body.skinning.skinned import Skinned
from ico3d.bundle.format import Bundle
from ico3d.bundle.skinned.posing import any_pose, recorded_pose
from ico3d.errors import SettingsError
from ico3d.motion.clip import Clip
from ico3d.motion.composing.performer import Performer
from ico3d.motion.footing import Footing, footing
from ico3d.motion.gestures.library import library
from ico3d.motion.living import Living, living
from ico3d.motion.recorded.cut import Cut
from ico3d.motion.recorded.cutting import find_cuts
from ico3d.motion.recorded.making import hung_in, recorded_clips
from ico3d.motion.recorded.recording import recording_of
from ico3d.motion.repertoire import preferring
from ico3d.rig.quaternions import Array
from ico3d.rig.rig import Rig
from ico3d.splat.gaussians import Gaussians, cat

DrawBody = Callable[[Array, Array], Gaussians]
"""Rotations (J, 4) wxyz and the root's shift (3,) → the body in the world."""
DrawHead = Callable[[Array, np.ndarray], Gaussians]
"""How the head moves (4, 4) from where it was recorded, and an expression (B,) → the head in the
world."""


@dataclass(frozen=True, eq=False)
class Poseable:
    """Somebody on a skeleton, who stands where they stood in one recorded frame.

    Attributes:
        living: How they stand.
        recorded: Rotations (J, 4) and root (3,) of that frame.
        body: Draws the body.
        head: Draws the head; None where there is a body alone.
        known: Their gestures; None makes those of the package.
        made: What they made in their recording, which comes before gestures of the package.
    """

    living: Living
    recorded: tuple[Array, Array]
    body: DrawBody
    head: DrawHead | None
    known: dict[str, Clip] | None = None
    made: dict[str, Clip] = field(default_factory=dict)

    @cached_property
    def clips(self) -> dict[str, Clip]:
        """Their gestures by name."""
        if self.known is not None:
            return self.known
        return preferring(self.made, library(self.living.person, hung=self.living.hung))

    @cached_property
    def footing(self) -> Footing:
        """Where they stand."""
        return footing(self.living, *self.recorded)

    def performer(self, seed: int) -> Performer:
        """Them, at rest, before they are told what to do."""
        return Performer(replace(self.living, seed=seed), self.clips)

    @torch.no_grad()
    def gaussians(self, by_role: Array, root: Array, expression: np.ndarray) -> Gaussians:
        """The whole person in the world, the body's Gaussians first.

        Args:
            by_role: (R, 4) as `Performer` gives it.
            root: (3,) metres that the root moves in rest space.
            expression: (B,) of the face, where there is one.
        """
        pose = self.footing.place(self.living.person.retarget.pose(by_role), root)
        body = self.body(*pose)
        return body if self.head is None else cat([body, self.head_in(*pose, expression)])

    @torch.no_grad()
    def head_in(self, rotations: Array, root: Array, expression: np.ndarray) -> Gaussians:
        """The head alone in a pose of the rig in the world; there must be one.

        Args:
            rotations: (J, 4) wxyz of each joint about itself.
            root: (3,) metres that the root moves from rest.
            expression: (B,).
        """
        assert self.head is not None
        person = self.living.person
        poses = (self.recorded, (rotations, root))
        before, after = (person.rig.matrices(*p)[person.cast.joints["head"][-1]] for p in poses)
        return self.head(after @ np.linalg.inv(before), expression)


def poseable_of(
    model: TrainedAvatar | TrainedBody | Bundle,
    frame: int | None,
    cuts: Sequence[Cut] | None = None,
) -> Poseable | None:
    """Somebody as a model has them.

    Args:
        model: Whoever can be posed; the face of a trained one takes expressions as recorded.
        frame: In which they stand as they shall; by default the middle of the recording.
        cuts: Gestures in the recording of a trained model; None finds them by rule. A bundle has
            its own.

    Returns:
        None where the body has no skeleton, or one without the joints that gestures need.
    """
    try:
        if isinstance(model, Bundle):
            return _baked(model, frame)
        body = model.body if isinstance(model, TrainedAvatar) else model
        rig = rig_of(body)
        return None if rig is None else _trained(model, body, rig, frame, cuts)
    except SettingsError:  # a rig without the roles of a person
        return None


def _baked(bundle: Bundle, frame: int | None) -> Poseable | None:
    baked = bundle.skinned
    if baked is None or bundle.gestures is None:
        return None
    frame = baked.info.num_frames // 2 if frame is None else frame
    stands = recorded_pose(baked, frame)
    return Poseable(
        living(baked.rig, 0, bundle.hung),
        (stands.rotations, stands.root),
        lambda rotations, root: skinned_gaussians(baked, any_pose(baked, rotations, root)),
        _baked_head(bundle, frame),
        bundle.gestures,
    )


def _baked_head(bundle: Bundle, frame: int) -> DrawHead | None:
    if bundle.head is None or bundle.world_from_head is None:
        return None
    head, placed = bundle.head, bundle.world_from_head[frame].astype(np.float64)
    return lambda moved, expression: baked_gaussians(head, expression).transform(moved @ placed)


def _trained(
    model: TrainedAvatar | TrainedBody,
    body: TrainedBody,
    rig: Rig,
    frame: int | None,
    cuts: Sequence[Cut] | None,
) -> Poseable:
    window = body.models[0]
    motion, values = window.motion, {**window.gaussians, **window.shared}
    assert isinstance(motion, Skinned)
    rotations, roots = trained_poses(body)
    frame = len(roots) // 2 if frame is None else frame

    def posed(rotations: Array, root: Array) -> Gaussians:
        pose = (torch.from_numpy(part).to(window.gaussians["means"]) for part in (rotations, root))
        return motion.posed(values, *pose)

    head = _trained_head(model, frame) if isinstance(model, TrainedAvatar) else None
    recording = recording_of(rig, body.fps, rotations)
    cuts = find_cuts(recording) if cuts is None else cuts
    rest, stands = living(rig, 0, hung_in(recording, cuts)), (rotations[frame], roots[frame])
    return Poseable(rest, stands, posed, head, made=recorded_clips(recording, cuts))


def _trained_head(avatar: TrainedAvatar, frame: int) -> DrawHead:
    head, placed = avatar.head, avatar.placement.world_from_head(frame)

    def drawn(moved: Array, expression: np.ndarray) -> Gaussians:
        values = torch.from_numpy(np.asarray(expression, np.float32))
        return head.model(values).transform(moved @ placed)

    return drawn
