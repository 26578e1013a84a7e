"""One interface to all that can be animated: trained bodies, avatars, and bundles."""

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
    """A body that can be animated, with or without a head."""

    @property
    def animation(self) -> Animation | None:
        """Animation in the model's folder or in the bundle; None if key frames must be found."""
        ...

    @property
    def recording(self) -> Recording | None:
        """Recorded motion of the skeleton; None for a body without a person's skeleton."""
        ...

    @property
    def cuts(self) -> tuple[Cut, ...] | None:
        """Recorded gestures, from the folder or the bundle; None if they must be found by rule."""
        ...

    @property
    def facing(self) -> np.ndarray | None:
        """(3,) direction in the world in which the person looks; None where it is unknown."""
        ...

    @property
    def seconds(self) -> float:
        """Length of the clip in seconds."""
        ...

    @property
    def has_head(self) -> bool:
        """Whether a separate model of the head is on the body."""
        ...

    @property
    def poseable(self) -> Poseable | None:
        """The person in poses that nobody recorded; None without a skeleton."""
        ...

    @property
    def idle(self) -> np.ndarray:
        """(B,) expression of the face at rest; (0,) without a head."""
        ...

    def gaussians(self, seconds: float) -> Gaussians:
        """The whole person in the world at a time in seconds."""
        ...

    def body_gaussians(self, seconds: float) -> Gaussians:
        """The body in the world at a time in seconds, without the head."""
        ...


@dataclass
class TrainedPerson:
    """A `Person` of a trained avatar or a trained body alone.

    Attributes:
        body: The trained body.
        avatar: The avatar that the body belongs to; None for a body alone.
        animation: Content of `animation.json` in the model's folder; None without that file.
        cuts: Content of `clips.toml` in the model's folder; None without that file.
    """

    body: TrainedBody
    avatar: TrainedAvatar | None
    animation: Animation | None
    cuts: tuple[Cut, ...] | None

    def __post_init__(self):
        """Copies what `Person` asks for from the body."""
        self.fps, self.windows, self.summary = self.body.fps, self.body.windows, self.body.summary
        self.seconds, self.window_gaussians = self.body.seconds, self.body.window_gaussians
        self.recording = recording_of_body(self.body)

    @property
    def facing(self) -> np.ndarray | None:
        """(3,) direction in the world in which the face looks; None for a body alone."""
        return self.avatar.placement.facing if self.avatar else None

    @property
    def has_head(self) -> bool:
        """Whether this is an avatar."""
        return self.avatar is not None

    @property
    def poseable(self) -> Poseable | None:
        """The person in any pose of the skeleton; None unless trained with --method skinned."""
        frame = self.animation.rest.end if self.animation else None
        return poseable_of(self.avatar or self.body, frame, self.cuts)

    @property
    def idle(self) -> np.ndarray:
        """(B,) expression recorded in the first frame; (0,) for a body alone."""
        return np.zeros(0, np.float32) if self.avatar is None else self.avatar.expression(0.0)

    def gaussians(self, seconds: float) -> Gaussians:
        """Body and, if there is one, head in the world at a time in seconds."""
        return (self.avatar or self.body).gaussians(seconds)

    @torch.no_grad()
    def body_gaussians(self, seconds: float) -> Gaussians:
        """The body in the world at a time in seconds, without the head."""
        return self.body.gaussians(seconds)


@dataclass
class BakedPerson:
    """A `Person` of a bundle with a body.

    Attributes:
        bundle: The opened bundle.
        device: Device on which the Gaussians are returned.
        summary: Empty: a bundle does not say how its body was made.
    """

    bundle: Bundle
    device: torch.device = CPU
    summary: dict = field(default_factory=dict)

    def __post_init__(self):
        """Copies what `Person` asks for from the bundle.

        Raises:
            BundleError: If the bundle has no body.
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
        """(3,) direction from the visitor's target to the visitor."""
        camera = self.bundle.manifest.camera
        return np.subtract(camera.eye, camera.target)

    @property
    def poseable(self) -> Poseable | None:
        """The person in any pose of the bundle's skeleton; None without a skeleton or gestures."""
        frame = self.animation.rest.end if self.animation else None
        return poseable_of(self.bundle, frame)

    @property
    def idle(self) -> np.ndarray:
        """(B,) idle expression of the manifest; (0,) without a head."""
        head = self.bundle.manifest.head
        return np.array(head.idle_expression if head else (), np.float32)

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """The Gaussians of a window in the world at τ in [0, 1]."""
        return self.body.window_gaussians(index, tau).to(self.device)

    @property
    def has_head(self) -> bool:
        """Whether the bundle has a head."""
        return self.bundle.manifest.head is not None

    def body_gaussians(self, seconds: float) -> Gaussians:
        """The body in the world at a time in seconds, without the head."""
        return body_gaussians(self.bundle, seconds).to(self.device)

    def gaussians(self, seconds: float) -> Gaussians:
        """Body and, if there is one, head with the idle face in the world at a time in seconds."""
        head = self.bundle.manifest.head
        if head is None:
            return body_gaussians(self.bundle, seconds).to(self.device)
        return avatar_gaussians(self.bundle, seconds, head.idle_expression).to(self.device)


def open_person(path: Path, device: torch.device) -> Person:
    """Opens a model folder or a bundle.

    Args:
        path: A folder of ico3d train body or ico3d assemble, or a bundle.
        device: Device on which the person is drawn.

    Raises:
        ModelError: If the path is none of these, or holds a damaged model.
        BundleError: If the bundle is damaged or has no body, or if the folder's `animation.json`
            makes no sense or belongs to another body.
        SettingsError: If the folder's `clips.toml` makes no sense or belongs to another body.
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
