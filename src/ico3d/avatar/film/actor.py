"""People who can be filmed: baked ones as viewers draw them, and exact ones of `ico3d assemble`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ico3d.avatar import staging
from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.baking import body_bundle, head_bundle
from ico3d.avatar.baking.samples import lips_of
from ico3d.avatar.moving import MOMENTS, back_and_forth, extent
from ico3d.avatar.poseable import Poseable, poseable_of
from ico3d.avatar.render_bundle import (
    BakedAvatar,
    backdrop_gaussians,
    body_gaussians,
    swaying_head,
)
from ico3d.bundle.animation import Animation
from ico3d.bundle.format import SPEECH, Bundle
from ico3d.bundle.manifest import CameraInfo
from ico3d.capture.capture import Capture
from ico3d.common.expression import SPEECH_SIZE
from ico3d.head.model_folder import TrainedHead
from ico3d.motion.recorded.cut import Cut
from ico3d.speech.runtime import open_speech
from ico3d.splat.gaussians import Gaussians

Draw = Callable[[float, np.ndarray], Gaussians]
"""Returns the person in the world at a time of the body in seconds, with an expression (B,)."""
Lips = Callable[[np.ndarray, int], np.ndarray]
"""Returns speech values (T, 32), 25 rows per second, for samples (S,) and samples per second."""


PORTRAIT = 3.1
"""Height of the view in a portrait of a whole person, in heights of the head."""
CHEST = 0.84
"""How far the middle of a portrait is below the middle of the head, in heights of the head."""


@dataclass(frozen=True)
class Actor:
    """A person who can be filmed.

    Attributes:
        draw: Returns the person in the world at a time of the body, with an expression (B,). The
            time of a head alone is that of its motion, which plays back and forth.
        seconds: Length of the recorded motion.
        view: Where a visitor stands.
        portrait: A camera before head and chest; the visitor's view where head and body are not
            both there.
        background: RGB in [0, 1].
        idle: (B,) expression of the face at rest; (0,) without a head.
        eye_offset: Index of the first of the seven eye and brow values in the expression; None
            where it has none.
        lips: Turns sound into speech values; None where sound does not drive the face.
        animation: How the body moves while it talks; None where head and body are not both there.
        backdrop: Splats behind the person, in the world; None where there are none.
        poseable: The person in any pose; None without a skeleton.
    """

    draw: Draw
    seconds: float
    view: CameraInfo
    portrait: CameraInfo
    background: tuple[float, float, float]
    idle: np.ndarray
    eye_offset: int | None
    lips: Lips | None
    animation: Animation | None
    backdrop: Gaussians | None = None
    poseable: Poseable | None = None


def bundle_actor(bundle: Bundle) -> Actor:
    """The baked person of a bundle.

    Raises:
        MissingModelError: If the bundle needs a speech encoder that is not on this machine.
        ModelError: If the bundle's speech model cannot be used.
    """
    manifest = bundle.manifest
    head, body = manifest.head, manifest.any_body
    lips = None
    if speech := manifest.speech:
        about = speech.encoder, speech.sha256, speech.input
        lips = open_speech(bundle.read(SPEECH), *about).expressions
    idle = np.array(head.idle_expression if head else (), np.float32)
    portrait = manifest.camera
    if bundle.manifest.is_whole:
        person = BakedAvatar.of(bundle)
        draw, seconds = person.gaussians, person.seconds
        poses = person.world_from_head
        points = [person.head.means @ pose[:3, :3].T + pose[:3, 3] for pose in poses]
        portrait = portrait_of(manifest.camera, np.concatenate(points))
    elif body is not None:
        draw, seconds = lambda at, _: body_gaussians(bundle, at), (body.num_frames - 1) / body.fps
    else:
        draw, seconds = _swaying_head(bundle)
    at = head.eye_offset if head else None
    stage = (manifest.camera, portrait, manifest.background)
    behind = backdrop_gaussians(bundle)
    frame = bundle.animation.rest.end if bundle.animation else None
    poseable = poseable_of(bundle, frame, visitor=np.array(portrait.eye))
    return Actor(draw, seconds, *stage, idle, at, lips, bundle.animation, behind, poseable)


def _swaying_head(bundle: Bundle) -> tuple[Draw, float]:
    """Draws a head alone, which plays its recorded motion back and forth; with its length in s."""
    _, poses = bundle.require_head()
    assert bundle.manifest.head is not None
    fps = bundle.manifest.head.fps
    seconds = (len(poses) - 1) / fps

    def draw(at: float, expression: np.ndarray) -> Gaussians:
        return swaying_head(bundle, expression, back_and_forth(at, seconds) * fps)

    return draw, seconds


def avatar_actor(
    avatar: TrainedAvatar,
    animation: Animation,
    capture: Capture | None,
    cuts: Sequence[Cut] | None = None,
) -> Actor:
    """The exact person that `ico3d assemble` made.

    Args:
        avatar: Who is filmed, on the device where it is drawn.
        animation: How the body moves while it talks.
        capture: The body's recording, for the upward direction and the background; without one
            +y is up and the background grey.
        cuts: Gestures in the body's recording; None finds them by rule.
    """
    points = extent(avatar)
    low, high = points.min(0), points.max(0)
    view = body_bundle.standing_camera(low, high, capture, avatar.placement.facing)
    moments = np.linspace(0, avatar.seconds, MOMENTS)
    face = [avatar.head_gaussians(float(moment)).means.cpu().numpy() for moment in moments]
    background = staging.background_colour(capture, 0) if capture else staging.NEUTRAL
    head = avatar.head
    driven = head.adaptor is not None
    return Actor(
        lambda seconds, expression: avatar.gaussians(seconds, head.recorded(expression)),
        avatar.seconds,
        view,
        portrait_of(view, np.concatenate(face)),
        background,
        head_bundle.idle_expression(head, avatar.expressions),
        SPEECH_SIZE if driven else None,
        (lambda samples, rate: lips_of(head, samples, rate)) if driven else None,
        animation,
        poseable=_driven(poseable_of(avatar, animation.rest.end, cuts), head),
    )


def _driven(person: Poseable | None, head: TrainedHead) -> Poseable | None:
    """A trained person whose face takes expressions that drive avatars, as that of a bundle does.

    Without this, it takes expressions as they were recorded (`TrainedHead.recorded` converts them).
    """
    if person is None or person.head is None:
        return person
    draw = person.head
    return replace(person, head=lambda moved, driven: draw(moved, head.recorded(driven)))


def portrait_of(view: CameraInfo, head: np.ndarray) -> CameraInfo:
    """A camera before head and chest, where gesturing hands are in view.

    Args:
        view: Where a visitor stands; the portrait looks in the same direction.
        head: (P, 3) positions of the head's Gaussians in the world, metres.
    """
    up = np.array(view.up) / np.linalg.norm(view.up)
    toward = np.subtract(view.eye, view.target)
    toward /= np.linalg.norm(toward)
    low, high = np.percentile(head @ up, (0.5, 99.5))
    middle = np.median(head, axis=0)
    target = middle + up * ((low + high) / 2 - middle @ up - CHEST * (high - low))
    away = PORTRAIT * (high - low) / 2 / np.tan(np.deg2rad(view.fov_y) / 2)
    eye = target + toward * away
    return CameraInfo(staging.triple(eye), staging.triple(target), view.up, view.fov_y)
