"""People on a skeleton, trained or baked, in poses that nobody recorded."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import torch

from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.baked_body import skinned_gaussians
from ico3d.avatar.head_joint import rig_of, trained_poses
from ico3d.avatar.render_bundle import baked_gaussians, gaze_at
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
"""Draws a body in the world.

Takes the joints' rotations (J, 4) wxyz and the root's translation (3,) in metres.
"""
DrawHead = Callable[[Array, np.ndarray], Gaussians]
"""Draws a head in the world.

Takes the rigid motion (4, 4) from the head's recorded place, and the expression (B,).
"""


@dataclass(frozen=True, eq=False)
class Poseable:
    """A person on a skeleton who can take any pose, standing where one recorded frame has them.

    Attributes:
        living: How the person stands and breathes.
        recorded: Rotations (J, 4) wxyz and root (3,) in metres of that recorded frame.
        body: Draws the body.
        head: Draws the head; None for a body without one.
        known: Gestures by name; None takes `made` and the package's gestures.
        made: Gestures by name from the person's recording; they replace the package's gestures of
            the same meaning.
    """

    living: Living
    recorded: tuple[Array, Array]
    body: DrawBody
    head: DrawHead | None
    known: dict[str, Clip] | None = None
    made: dict[str, Clip] = field(default_factory=dict)

    @cached_property
    def clips(self) -> dict[str, Clip]:
        """The person's gestures by name."""
        if self.known is not None:
            return self.known
        return preferring(self.made, library(self.living.person, hung=self.living.hung))

    @cached_property
    def footing(self) -> Footing:
        """How to place poses so that the person stands where the recorded frame has them."""
        return footing(self.living, *self.recorded)

    def performer(self, seed: int) -> Performer:
        """A performer of this person, at rest.

        Args:
            seed: Seed of the small movements at rest.
        """
        return Performer(replace(self.living, seed=seed), self.clips)

    @torch.no_grad()
    def gaussians(self, by_role: Array, root: Array, expression: np.ndarray) -> Gaussians:
        """The whole person in the world, the body's Gaussians first.

        Args:
            by_role: (R, 4) rotations by role, as from `Performer.at`.
            root: (3,) translation of the root in rest space, metres.
            expression: (B,); not used without a head.
        """
        pose = self.footing.place(self.living.person.retarget.pose(by_role), root)
        body = self.body(*pose)
        return body if self.head is None else cat([body, self.head_in(*pose, expression)])

    @torch.no_grad()
    def head_in(self, rotations: Array, root: Array, expression: np.ndarray) -> Gaussians:
        """The head alone, in the world, for a pose of the rig; the person must have a head.

        Args:
            rotations: (J, 4) local rotation of each joint, wxyz.
            root: (3,) translation of the root from rest, metres.
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
    visitor: np.ndarray | None = None,
) -> Poseable | None:
    """The poseable person of a trained model or bundle.

    Args:
        model: Avatar, body or bundle. The head of an avatar takes recorded expressions
            (`TrainedHead.recorded`), that of a bundle takes expressions as speech drives them.
        frame: Recorded frame that says where the person stands; by default the middle frame.
        cuts: Gestures in the recording of a trained model; None finds them by rule. Not used for
            bundles, which have their own.
        visitor: (3,) point in the world, metres, at which the eyes of a bundle's head look if they
            turn; by default they look where the head does.

    Returns:
        The person; None where the body has no skeleton, or one without the joints that gestures
        need.
    """
    try:
        if isinstance(model, Bundle):
            return _baked(model, frame, visitor)
        body = model.body if isinstance(model, TrainedAvatar) else model
        rig = rig_of(body)
        return None if rig is None else _trained(model, body, rig, frame, cuts)
    except SettingsError:  # a rig without the roles of a person
        return None


def _baked(bundle: Bundle, frame: int | None, visitor: np.ndarray | None) -> Poseable | None:
    baked = bundle.skinned
    if baked is None or bundle.gestures is None:
        return None
    frame = baked.info.num_frames // 2 if frame is None else frame
    stands = recorded_pose(baked, frame)
    return Poseable(
        living(baked.rig, 0, bundle.hung),
        (stands.rotations, stands.root),
        lambda rotations, root: skinned_gaussians(baked, any_pose(baked, rotations, root)),
        _baked_head(bundle, frame, visitor),
        bundle.gestures,
    )


def _baked_head(bundle: Bundle, frame: int, visitor: np.ndarray | None) -> DrawHead | None:
    info = bundle.manifest.head
    if info is None or bundle.head is None or bundle.world_from_head is None:
        return None
    head, placed = bundle.head, bundle.world_from_head[frame].astype(np.float64)

    def drawn(moved: Array, expression: np.ndarray) -> Gaussians:
        pose = moved @ placed
        gaze = None
        if info.gaze is not None and visitor is not None:
            gaze = gaze_at(info.gaze, np.linalg.inv(pose), visitor)
        return baked_gaussians(head, expression, gaze).transform(pose)

    return drawn


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
