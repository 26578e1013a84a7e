"""Bakes a trained head and its capture into a bundle."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar import staging
from ico3d.avatar.baking import head_cost
from ico3d.avatar.baking.eyes.catchlights import SHUT, with_catchlights
from ico3d.avatar.baking.eyes.eyeballs import eyeballs_of, turned_by_gaze
from ico3d.avatar.baking.samples import Samples
from ico3d.avatar.baking.shader_head import BakeSettings, HeadBaker, megabytes_per_10k
from ico3d.avatar.baking.telling.about import About
from ico3d.avatar.joining.similarity import moved
from ico3d.avatar.render_bundle import baked_gaussians
from ico3d.bundle.format import HEAD, LICENSES, POSES, SPEECH, THUMBNAIL, coarse_first, write_bundle
from ico3d.bundle.head import SHOULDERS, BakedHead, BakedShoulders, poses_to_bytes
from ico3d.bundle.manifest import (
    GazeInfo,
    HeadInfo,
    Loss,
    Manifest,
    SpeechInfo,
)
from ico3d.capture.capture import Capture
from ico3d.common.expression import EYE_NAMES, LIDS, SPEECH_SIZE
from ico3d.errors import BundleError
from ico3d.head.expressions import FEATURE_RATE
from ico3d.head.model_folder import TrainedHead
from ico3d.head.portrait.shoulders import shoulders_of
from ico3d.head.views import PictureCache
from ico3d.speech.encoder import load_encoder
from ico3d.speech.export import export_speech, make_servable
from ico3d.speech.network import SpeechAdaptor

RANKS = (16, 20, 24, 28, 32)
"""Ranks K that are tried in this order where none is asked for.

No smaller ones: means over views would not notice that rare blinks are lost. No larger ones: with
38 + 4·K bytes per Gaussian, 32 is the largest that keeps `MAX_MEGABYTES`. `ico3d.bundle.limits` has
the largest rank that a bundle can hold.
"""
MAX_MEGABYTES = 1.7
"""Most MB of head.safetensors per 10,000 Gaussians."""
MEASURED_VIEWS = 40
"""Most pictures that a baked head is measured with."""

Report = Callable[[str], None]
"""Prints a line about the progress."""


@dataclass(frozen=True)
class BakedResult:
    """A baked head and what it costs.

    Attributes:
        head: The baked head.
        loss: Loss of baking, means over views.
        megabytes: MB of head.safetensors per 10,000 Gaussians.
    """

    head: BakedHead
    loss: Loss
    megabytes: float

    @property
    def acceptable(self) -> bool:
        """Whether loss and size are within the bounds."""
        return head_cost.acceptable(self.loss) and self.megabytes <= MAX_MEGABYTES

    def __str__(self) -> str:
        """One line for people."""
        return (
            f"rank {self.head.rank}: {head_cost.in_words(self.loss)}, "
            f"{self.megabytes:.2f} MB per 10,000 of {self.head.num_gaussians} Gaussians"
        )


def bake(
    head: TrainedHead,
    views: list[head_cost.Reference],
    samples: Samples,
    rank: int | None,
    report: Report,
    settings: BakeSettings | None = None,
) -> BakedResult:
    """Bakes with the given rank, or with the smallest of `RANKS` that keeps all bounds.

    Where none does, the result is the one nearest to the exact head, of those within
    `MAX_MEGABYTES` if there are any.

    Args:
        head: The exact head.
        views: Pictures that the baked head is compared with.
        samples: Expressions, and how much each logit of a Gaussian matters.
        rank: Number K of basis vectors; None chooses it.
        report: Called with a line about each result.
        settings: Settings of the fit; the defaults where None.
    """
    report("sampling the exact head …")
    chosen = settings or BakeSettings()
    most = rank or RANKS[-1]
    given = (samples.expressions, samples.importance, most, chosen, head.landmarks)
    baker = HeadBaker(head.model, *given)
    results = []
    for candidate in (rank,) if rank else RANKS:
        baked = baker.baked(candidate)
        result = BakedResult(baked, head_cost.measure(baked, views), megabytes_per_10k(baked))
        report(str(result))
        if result.acceptable:
            return result
        results.append(result)
    within = [result for result in results if result.megabytes <= MAX_MEGABYTES]
    return max(within or results, key=lambda result: result.loss.psnr_baked_vs_exact or 0)


def check(result: BakedResult) -> None:
    """Refuses a result that breaks a bound.

    Raises:
        BundleError: If loss or size break a bound; the sentence says what was measured.
    """
    if not result.acceptable:
        raise BundleError(
            f"baking costs too much ({result}; allowed are {head_cost.MAX_DROP} dB lost, at least "
            f"{head_cost.MIN_LIKENESS:g} dB against exact, {MAX_MEGABYTES} MB): train longer, or "
            "use --force."
        )


def write(
    out: Path,
    result: BakedResult,
    samples: Samples,
    head: TrainedHead,
    capture: Capture,
    about: About,
) -> Manifest:
    """Adds motion, camera, speech and thumbnail to a baked head, and writes the bundle.

    Args:
        out: The file to write.
        result: The baked head and its loss.
        samples: The samples that the head was baked from.
        head: The exact head, for its speech adaptor.
        capture: The head's recording, for motion, camera and background.
        about: What else the bundle tells.

    Raises:
        BundleError: If the bundle fails a check.
    """
    motion = staging.idle_motion(capture)
    poses = motion.poses
    frontal = staging.frontal_camera(capture)
    idle = idle_expression(head, samples.expressions)
    baked, gaze = finished(result.head, head, idle, np.eye(4))
    seen = baked_gaussians(baked, idle)
    middle = poses[len(poses) // 2]
    points = seen.means[seen.opacities > 0.1].numpy() @ middle[:3, :3].T + middle[:3, 3]  # (P, 3)
    camera = staging.visitor_view(capture.cameras[frontal], points)
    background = staging.background_colour(capture, frontal)
    files = {
        HEAD: baked.to_bytes(),
        POSES: poses_to_bytes(poses),
        THUMBNAIL: staging.thumbnail(seen.transform(middle), camera, background),
    }
    if (shoulders := _shoulders(baked, head, capture, motion)) is not None:
        files[SHOULDERS] = shoulders.to_bytes()
    speech = None
    if head.adaptor is not None:
        files[SPEECH], speech = speech_file(head.adaptor, head.encoder)
    if about.notices:
        files[LICENSES] = about.notices.encode()
    manifest = Manifest(
        name=about.name,
        head=head_info(baked, head, idle, capture.fps, len(poses), gaze),
        body=None,
        speech=speech,
        camera=camera,
        background=background,
        persona=about.persona,
        loss=result.loss,
        provenance=about.provenance,
    )
    return write_bundle(out, *coarse_first(manifest, files))


def _shoulders(
    baked: BakedHead, head: TrainedHead, capture: Capture, motion: staging.IdleMotion
) -> BakedShoulders | None:
    """How the shoulders of a portrait stand while its head sways; None where they follow it."""
    neck = head.model.shape.neck
    seen = shoulders_of(capture, neck, PictureCache(capture, 0))
    if neck is None or seen is None:
        return None
    share = neck.follows(torch.from_numpy(baked.means.copy())).numpy()  # (N,)
    frames = range(motion.first, motion.first + len(motion.poses))
    places = staging.smoothed(np.stack([seen.place(frame) for frame in frames]))  # (F, 4, 4)
    return BakedShoulders(np.round(255 * share).astype(np.uint8), places.astype(np.float32))


def idle_expression(head: TrainedHead, recorded: np.ndarray) -> np.ndarray:
    """(B,) expression of an avatar at rest: silence with open eyes.

    Eyes and brows at rest are 0 in expressions that drive an avatar (`TrainedHead.recorded`). For a
    head driven by blendshapes, it is the recorded row with the least sum of absolute values.

    Args:
        head: The exact head.
        recorded: (T, B) recorded expressions.
    """
    if head.adaptor is None:
        return recorded[np.abs(recorded).sum(axis=1).argmin()]
    return np.concatenate([head.neutral()[:SPEECH_SIZE], np.zeros(len(head.eyes.rest), np.float32)])


def driven(baked: BakedHead, head: TrainedHead) -> BakedHead:
    """A baked head that takes the expressions that drive avatars, instead of recorded ones.

    `TrainedHead.recorded` converts them, value by value and linearly, so it is merged into the
    first layers of both networks.

    Args:
        baked: Takes expressions as they were recorded.
        head: The exact head, with the conversion.
    """
    size = baked.expression_size
    offset = head.recorded(np.zeros(size, np.float32))  # (B,)
    slope = head.recorded(np.ones(size, np.float32)) - offset  # (B,)
    bias = baked.b1 + offset.astype(np.float64) @ baked.w1
    moved = baked.displacement_b1 + offset.astype(np.float64) @ baked.displacement_w1
    return replace(
        baked,
        w1=slope[:, None] * baked.w1,
        b1=bias.astype(np.float32),
        displacement_w1=slope[:, None] * baked.displacement_w1,
        displacement_b1=moved.astype(np.float32),
    )


def finished(
    baked: BakedHead, head: TrainedHead, idle: np.ndarray, placed: np.ndarray
) -> tuple[BakedHead, GazeInfo | None]:
    """A baked head as bundles have it: `driven`, and where eyes are found they turn and mirror.

    Args:
        baked: Takes expressions as they were recorded.
        head: The exact head.
        idle: (B,) expression at rest.
        placed: (4, 4) similarity from the space of the exact head to that of the baked one.
    """
    marks = None if head.landmarks is None else moved(placed, head.landmarks)  # (68, 3)
    drawn = driven(baked, head)
    balls = eyeballs_of(drawn, idle, marks)
    if not balls:
        return drawn, None
    return turned_by_gaze(*with_catchlights(drawn, balls, idle, _shut(head, idle)))


def _shut(head: TrainedHead, idle: np.ndarray) -> np.ndarray:
    """The expression at rest (B,) with lids that cover the eyes' middles."""
    shut = idle.copy()
    if head.adaptor is not None:
        shut[[SPEECH_SIZE + lid for lid in LIDS]] = SHUT
    else:
        names = [EYE_NAMES[lid] for lid in LIDS]
        shut[[i for i, name in enumerate(head.blendshape_names) if name in names]] = SHUT
    return shut


def eyes_in_words(manifest: Manifest) -> str:
    """Whether the eyes of a bundle's head turn."""
    if manifest.head is not None and manifest.head.gaze is not None:
        sides, up = np.degrees(manifest.head.gaze.most)
        return f"its eyes turn, up to {sides:.0f}° to the side and {up:.0f}° up or down."
    return "its eyes look where the head does: no eyeballs were found behind the lids' landmarks."


def speech_file(adaptor: SpeechAdaptor, encoder_name: str) -> tuple[bytes, SpeechInfo]:
    """Content of `speech.onnx`, and the manifest's entry about it.

    A speech encoder that is not the built-in one stays on this machine: the file then takes its
    features instead of sound.
    """
    encoder = load_encoder(encoder_name)
    kind = "mel"
    if encoder.name != "builtin":  # the user's own encoder stays on this machine
        kind = "features"
        make_servable(encoder)
    info = SpeechInfo(encoder.name, encoder.sha256, FEATURE_RATE, kind)
    return export_speech(adaptor, encoder), info


def head_info(
    baked: BakedHead,
    head: TrainedHead,
    idle: np.ndarray,
    fps: float,
    num_poses: int,
    gaze: GazeInfo | None,
) -> HeadInfo:
    """The manifest's entry about a head.

    Args:
        baked: The baked head.
        head: The exact head.
        idle: (B,) expression at rest.
        fps: Head poses per second.
        num_poses: Number of head poses.
        gaze: How its eyes turn, if they do.
    """
    speech = head.adaptor is not None
    return HeadInfo(
        num_gaussians=baked.num_gaussians,
        rank=baked.rank,
        hidden=baked.hidden,
        inputs=head.inputs,
        expression_size=baked.expression_size,
        eye_offset=SPEECH_SIZE if speech else None,
        expression_names=() if speech else head.blendshape_names,
        fps=fps,
        num_poses=num_poses,
        idle_expression=tuple(round(float(value), 6) for value in idle),
        num_displacements=baked.num_displacements,
        gaze=gaze,
    )
