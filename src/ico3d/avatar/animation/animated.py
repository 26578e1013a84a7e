"""Whoever can be animated: trained bodies, avatars, and bundles, seen in one way."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
import torch

from ico3d.avatar.animation.keyframes import read_animation
from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.baked_body import body_of
from ico3d.avatar.models import open_model
from ico3d.avatar.moving import MovingBody, Span
from ico3d.avatar.poseable import Poseable, poseable_of
from ico3d.avatar.recorded import read_cuts, recording_of_body
from ico3d.avatar.render_bundle import avatar_gaussians, body_gaussians
from ico3d.body.model_folder import TrainedBody
from ico3d.bundle.animation import Animation
from ico3d.bundle.format import Bundle
from ico3d.bundle.skinned.gestures import recording_in
from ico3d.motion.recorded.cut import Cut
from ico3d.motion.recorded.recording import Recording
from ico3d.splat.device import CPU
from ico3d.splat.gaussians import Gaussians


class Person(MovingBody, Protocol):
    """A body, perhaps with a head."""

    @property
    def animation(self) -> Animation | None:
        """What lies beside it, or in the bundle; None where key frames are to be found."""
        ...

    @property
    def recording(self) -> Recording | None:
        """How it moved; None of bodies without a skeleton of a person."""
        ...

    @property
    def cuts(self) -> tuple[Cut, ...] | None:
        """What it did there: beside it, or in the bundle; None where that is to be found."""
        ...

    @property
    def facing(self) -> np.ndarray | None:
        """(3,) where it looks, in the world; None where nobody knows."""
        ...

    @property
    def seconds(self) -> float:
        """How long the clip lasts."""
        ...

    @property
    def has_head(self) -> bool:
        """Whether a head of its own kind is on the body."""
        ...

    @property
    def poseable(self) -> Poseable | None:
        """The person in poses that nobody recorded; None without a skeleton."""
        ...

    @property
    def idle(self) -> np.ndarray:
        """(B,) the face at rest; (0,) without a head."""
        ...

    def gaussians(self, seconds: float) -> Gaussians:
        """All of the person in the world at a time."""
        ...

    def body_gaussians(self, seconds: float) -> Gaussians:
        """The person's body in the world at a time, without the head."""
        ...


@dataclass
class TrainedPerson:
    """A trained body, or the one of an avatar.

    Attributes:
        body: What moves.
        avatar: What is seen; None for a body alone.
        animation: What lies in the model's folder as `animation.json`; None where nothing does.
        cuts: What lies there as `clips.toml`; None where nothing does.
    """

    body: TrainedBody
    avatar: TrainedAvatar | None
    animation: Animation | None
    cuts: tuple[Cut, ...] | None

    def __post_init__(self):
        """Takes over what the body says of itself."""
        self.fps, self.windows, self.summary = self.body.fps, self.body.windows, self.body.summary
        self.seconds, self.window_gaussians = self.body.seconds, self.body.window_gaussians
        self.recording = recording_of_body(self.body)

    @property
    def facing(self) -> np.ndarray | None:
        """Where the face looks, if there is one."""
        return self.avatar and self.avatar.placement.facing

    @property
    def has_head(self) -> bool:
        """Whether this is an avatar."""
        return self.avatar is not None

    @property
    def poseable(self) -> Poseable | None:
        """On the skeleton that a body of --method skinned has."""
        frame = self.animation and self.animation.rest.end
        return poseable_of(self.avatar or self.body, frame, self.cuts)

    @property
    def idle(self) -> np.ndarray:
        """The face as it was recorded in the first frame."""
        return np.zeros(0, np.float32) if self.avatar is None else self.avatar.expression(0.0)

    def gaussians(self, seconds: float) -> Gaussians:
        """Body and, if there is one, head in the world at a time."""
        return (self.avatar or self.body).gaussians(seconds)

    @torch.no_grad()
    def body_gaussians(self, seconds: float) -> Gaussians:
        """The body alone."""
        return self.body.gaussians(seconds)


@dataclass
class BakedPerson:
    """A bundle with a body.

    Attributes:
        bundle: The opened bundle.
        device: Where its Gaussians are drawn.
        summary: Empty: a bundle does not say how its body was made.
    """

    bundle: Bundle
    device: torch.device = CPU
    summary: dict = field(default_factory=dict)

    def __post_init__(self):
        """Takes over what the manifest says of the body.

        Raises:
            BundleError: If there is none.
        """
        self.body = body_of(self.bundle)
        self.fps = self.body.fps
        self.windows: Sequence[Span] = self.body.windows
        self.seconds = self.windows[-1].last / self.fps
        self.animation = self.bundle.animation
        skinned = self.bundle.skinned
        self.recording = None if skinned is None else recording_in(skinned)
        self.cuts: tuple[Cut, ...] | None = self.bundle.cuts

    @property
    def facing(self) -> np.ndarray:
        """Towards the visitor."""
        camera = self.bundle.manifest.camera
        return np.subtract(camera.eye, camera.target)

    @property
    def poseable(self) -> Poseable | None:
        """On the bundle's skeleton, with its gestures."""
        return poseable_of(self.bundle, self.animation and self.animation.rest.end)

    @property
    def idle(self) -> np.ndarray:
        """What the manifest says."""
        head = self.bundle.manifest.head
        return np.array(head.idle_expression if head else (), np.float32)

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """The Gaussians of a window."""
        return self.body.window_gaussians(index, tau).to(self.device)

    @property
    def has_head(self) -> bool:
        """Whether the bundle has a head."""
        return self.bundle.manifest.head is not None

    def body_gaussians(self, seconds: float) -> Gaussians:
        """The body alone."""
        return body_gaussians(self.bundle, seconds).to(self.device)

    def gaussians(self, seconds: float) -> Gaussians:
        """With an idle face, if there is a head."""
        head = self.bundle.manifest.head
        if head is None:
            return body_gaussians(self.bundle, seconds).to(self.device)
        return avatar_gaussians(self.bundle, seconds, head.idle_expression).to(self.device)


def open_person(path: Path, device: torch.device) -> Person:
    """Opens a model folder or a bundle.

    Args:
        path: A folder of ico3d train body or ico3d assemble, or a bundle.
        device: Where its Gaussians shall be.

    Raises:
        ModelError: If it is none of them, or holds a damaged model.
        BundleError: If the bundle is damaged or has no body, or if there is an animation that makes
            no sense, or is for another body.
        SettingsError: If there are cuts that make no sense, or are of another body.
    """
    model = open_model(path, TrainedAvatar, TrainedBody, Bundle)
    if isinstance(model, Bundle):
        return BakedPerson(model, device)
    model.to(device)
    if isinstance(model, TrainedAvatar):
        body, avatar = model.body, model
    else:
        body, avatar = model, None
    return TrainedPerson(body, avatar, read_animation(path, body), read_cuts(path, body))
