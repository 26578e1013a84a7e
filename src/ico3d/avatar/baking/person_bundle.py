"""Bakes a whole person, a trained head on a trained body, into a bundle that browsers play."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar import clip_views, staging
from ico3d.avatar.animation import motion_quality
from ico3d.avatar.animation.keyframes import Motion, find_animation, read_animation
from ico3d.avatar.avatar import TrainedAvatar
from ico3d.avatar.baking import body_bundle, body_cost, head_bundle, head_cost
from ico3d.avatar.baking.body_bundle import BodyParts
from ico3d.avatar.baking.persona import spoken_texts
from ico3d.avatar.baking.quantise import in_units
from ico3d.avatar.baking.samples import (
    Samples,
    expressions_at,
    references_around,
    samples_around,
    spoken_expressions,
)
from ico3d.avatar.baking.telling.about import About
from ico3d.avatar.moving import MOMENTS
from ico3d.avatar.render_bundle import BakedAvatar
from ico3d.body.planning.windows import Window
from ico3d.bundle.animation import ANIMATION, Animation
from ico3d.bundle.format import LICENSES, SPEECH, THUMBNAIL, coarse_first, write_bundle
from ico3d.bundle.head import HEAD, POSES, BakedHead, poses_to_bytes
from ico3d.bundle.manifest import CameraInfo, Loss, Manifest, Persona
from ico3d.capture.capture import Capture
from ico3d.errors import BundleError
from ico3d.head.model_folder import TrainedHead
from ico3d.splat.gaussians import Gaussians

VIEWS = 40
"""Most pictures that a whole person is measured with."""
MAX_DROP = head_cost.MAX_DROP
"""Most dB, on the person against ground truth, that a whole person may lose."""
_STRIP_ROWS = 4
"""Rows of the comparison picture."""


@dataclass(frozen=True)
class WholeResult:
    """A baked person and what it costs.

    Attributes:
        person: The baked person, as viewers draw it.
        body: The baked body, with its files.
        idle: (B,) expression of the face at rest.
        loss: Loss of baking, means over pictures of the whole person.
    """

    person: BakedAvatar
    body: BodyParts
    idle: np.ndarray
    loss: Loss


def head_samples(
    avatar: TrainedAvatar, capture: Capture | None, persona: Persona
) -> tuple[Samples, list[head_cost.Reference]]:
    """Samples that the head is baked from, and pictures that it is measured with.

    Args:
        avatar: The exact person.
        capture: The head's recording: the head is baked from the expressions of its training
            frames and measured with those of its test frames. Without it, the expressions are
            those of the body's recording and, of a head driven by speech, those of synthetic
            voices that read the persona's `spoken_texts`.
        persona: Who the avatar is.

    Raises:
        MissingExtraError: If synthetic voices are needed and espeak-ng is not installed.
    """
    head, expressions = avatar.head, avatar.expressions
    if capture is not None:
        return recorded_head(head, capture)
    if head.adaptor is not None:
        expressions = np.concatenate([expressions, spoken_expressions(head, spoken_texts(persona))])
    return _around(head, expressions, avatar.expressions)


def recorded_head(head: TrainedHead, capture: Capture) -> tuple[Samples, list[head_cost.Reference]]:
    """As `head_samples`, of a head and its recording."""
    track, split = head.track(capture), capture.split
    tests = expressions_at(track, split.test or split.train)
    return _around(head, expressions_at(track, split.train), tests)


def _around(
    head: TrainedHead, expressions: np.ndarray, tests: np.ndarray
) -> tuple[Samples, list[head_cost.Reference]]:
    """Samples from expressions (T, B), and pictures with others (V, B)."""
    samples = samples_around(head, expressions)
    return samples, references_around(head, tests, head_bundle.MEASURED_VIEWS)


def head_at(avatar: TrainedAvatar) -> body_cost.HeadAt:
    """Returns the exact head at a frame: the baked body is measured with it."""
    return lambda frame: avatar.head_gaussians(frame / avatar.fps)


def put_together(
    avatar: TrainedAvatar,
    head: BakedHead,
    body: BodyParts,
    expressions: np.ndarray,
    capture: Capture | None,
) -> WholeResult:
    """Joins baked head and body, and measures them with the expressions of the body's recording.

    Args:
        avatar: The exact person.
        head: The baked head, in the space of the exact head's model.
        body: The baked body.
        expressions: (T, B) expressions that the head was baked from.
        capture: The body's recording; None measures against the exact person only.
    """
    place = avatar.placement
    person = BakedAvatar(
        moved_head(head, place.canonical_from_head),
        body.baked,
        place.world_from_canonical,
    )
    idle = head_bundle.idle_expression(avatar.head, expressions)
    return WholeResult(person, body, idle, measure(avatar, person, capture))


def moved_head(head: BakedHead, a_from_b: np.ndarray) -> BakedHead:
    """Converts a baked head from space b to space a by a (4, 4) similarity."""
    moved = Gaussians(
        means=torch.from_numpy(head.means.astype(np.float64)),
        quats=torch.from_numpy(head.quats.astype(np.float64)),
        scales=torch.from_numpy(head.scales.astype(np.float64)).exp(),
        opacities=torch.ones(head.num_gaussians),
    ).transform(a_from_b)
    return replace(
        head,
        **_turned_displacements(head, a_from_b[:3, :3]),
        means=moved.means.numpy().astype(np.float32),
        quats=torch.nn.functional.normalize(moved.quats).numpy().astype(np.float16),
        scales=moved.scales.log().numpy().astype(np.float16),
    )


def _turned_displacements(head: BakedHead, linear: np.ndarray) -> dict[str, np.ndarray]:
    """Displacements after a rotation with a scale (3, 3), and the layer that has their unit."""
    values, units = in_units(head.displacement_basis @ linear.T.astype(np.float32))
    return {
        "displacement_basis": values,
        "displacement_w2": (head.displacement_w2 * units).astype(np.float32),
        "displacement_b2": (head.displacement_b2 * units).astype(np.float32),
    }


def measure(avatar: TrainedAvatar, person: BakedAvatar, capture: Capture | None) -> Loss:
    """Mean PSNR on the whole person, of pictures from all of the clip.

    Args:
        avatar: The exact person.
        person: The baked person.
        capture: The body's recording; None measures against the exact person only.
    """
    span = _span(avatar)
    recorded = clip_views.recorded_views(capture, span, VIEWS) if capture else []
    return body_cost.measure(*_pair(avatar, person), recorded, _probes(avatar, person, VIEWS))


def check(result: WholeResult) -> None:
    """Refuses a whole person that breaks the bound.

    Raises:
        BundleError: If the loss breaks the bound; the sentence says what was measured.
    """
    if (head_cost.drop(result.loss) or 0.0) > MAX_DROP:
        raise BundleError(
            f"baking costs the whole person too much ({head_cost.in_words(result.loss)}; allowed "
            f"are {MAX_DROP} dB lost): train longer, or use --force."
        )


def strip(avatar: TrainedAvatar, person: BakedAvatar, capture: Capture | None) -> np.ndarray:
    """A picture that compares exact and baked person, one row for each of some views.

    Returns:
        (rows·H, 3·W, 3) uint8: recorded | exact | baked; (rows·H, 2·W, 3) without a capture.
    """
    views = _probes(avatar, person, _STRIP_ROWS)
    if capture is not None:
        views = clip_views.recorded_views(capture, _span(avatar), _STRIP_ROWS)
    lines = [body_cost.comparison_line(*_pair(avatar, person), view) for view in views]
    return head_cost.stacked(lines)


def animation_of(folder: Path, avatar: TrainedAvatar) -> Animation:
    """The animation in `animation.json` of the avatar's folder, or else one that is found.

    Raises:
        BundleError: If the file makes no sense, or belongs to another body.
    """
    return read_animation(folder, avatar.body) or find_animation(Motion.of(avatar.body))


def with_quality(
    animation: Animation, avatar: TrainedAvatar, person: BakedAvatar, capture: Capture | None
) -> Animation:
    """The animation with each frame's quality, measured on the baked person.

    Args:
        animation: The rest loop and actions, as found or edited.
        avatar: The exact person, for the recorded expressions.
        person: The baked person, which will be played.
        capture: The body's recording; without it the quality is left empty.

    Raises:
        CaptureError: If the capture is the recording of another body.
    """
    if capture is None:
        return replace(animation, quality=())
    length, device = avatar.seconds, avatar.body.device
    quality = motion_quality.measure_motion(
        _pair(avatar, person)[1],
        lambda tau: person.body_gaussians(tau * length).to(device),
        capture,
        _span(avatar),
    )
    return replace(animation, quality=quality)


def write(
    out: Path,
    avatar: TrainedAvatar,
    result: WholeResult,
    animation: Animation,
    capture: Capture | None,
    about: About,
) -> Manifest:
    """Adds animation, camera, speech and thumbnail to a baked person, and writes the bundle.

    Args:
        out: The file to write.
        avatar: The exact person.
        result: The baked person.
        animation: The rest loop and actions.
        capture: The body's recording, for camera and background; None where it is not at hand.
        about: What else the bundle tells.

    Raises:
        BundleError: If the animation belongs to another body, or the bundle fails a check.
    """
    head = avatar.head
    placed = avatar.placement.canonical_from_head
    finished, gaze = head_bundle.finished(result.person.head, head, result.idle, placed)
    person = replace(result.person, head=finished)
    start = person.gaussians(animation.rest.start / avatar.fps, result.idle)
    animation.check_body(result.body.entry)
    camera = standing_camera(avatar, person, capture)
    background = staging.background_colour(capture, 0) if capture else staging.NEUTRAL
    files = result.body.files | {
        HEAD: person.head.to_bytes(),
        POSES: poses_to_bytes(person.world_from_head),
        ANIMATION: animation.to_bytes(),
        THUMBNAIL: staging.thumbnail(start, camera, background),
    }
    speech = None
    if head.adaptor is not None:
        files[SPEECH], speech = head_bundle.speech_file(head.adaptor, head.encoder)
    if about.notices:
        files[LICENSES] = about.notices.encode()
    poses = len(person.world_from_head)
    manifest = Manifest(
        name=about.name,
        head=head_bundle.head_info(person.head, head, result.idle, avatar.fps, poses, gaze),
        **result.body.entries,
        speech=speech,
        camera=camera,
        background=background,
        persona=about.persona,
        loss=result.loss,
        provenance=about.provenance,
    )
    return write_bundle(out, *coarse_first(manifest, files))


def standing_camera(
    avatar: TrainedAvatar, person: BakedAvatar, capture: Capture | None
) -> CameraInfo:
    """A camera in front of the person, so far away that all of the person is in view."""
    return body_bundle.standing_camera(*_box(person), capture, avatar.placement.facing)


def _span(avatar: TrainedAvatar) -> Window:
    return Window(0, avatar.body.windows[-1].last)


def _pair(avatar: TrainedAvatar, person: BakedAvatar) -> tuple[clip_views.At, clip_views.At]:
    """The exact and the baked person at τ of the whole clip, with the recorded expression."""
    length, device = avatar.seconds, avatar.body.device
    return (
        lambda tau: avatar.gaussians(tau * length),
        lambda tau: person.gaussians(tau * length, avatar.expression(tau * length)).to(device),
    )


def _probes(avatar: TrainedAvatar, person: BakedAvatar, count: int) -> list[clip_views.View]:
    ring = body_cost.ring_of_cameras(*_box(person))
    return body_cost.probe_views(ring, _span(avatar), count)


def _box(person: BakedAvatar) -> tuple[np.ndarray, np.ndarray]:
    """Bounding box of what is seen: (3,) least and (3,) greatest coordinates.

    The body counts at a few times of each window, the head where windows begin and end.
    """
    boxes = []
    taus = np.linspace(0, 1, max(3, MOMENTS // len(person.body.windows))).tolist()
    for index, span in enumerate(person.body.windows):
        at = partial(person.body.window_gaussians, index)
        boxes.append(body_bundle.seen_box(at, taus))
        for frame in (span.first, span.last):
            boxes.append(_head_box(person, frame))
    low, high = zip(*boxes, strict=True)
    return np.min(low, axis=0), np.max(high, axis=0)


def _head_box(person: BakedAvatar, frame: int) -> tuple[np.ndarray, np.ndarray]:
    pose = person.world_from_head[frame]
    points = person.head.means @ pose[:3, :3].T + pose[:3, 3]  # (N, 3)
    low, high = np.percentile(points, (0.5, 99.5), axis=0)
    return low, high
