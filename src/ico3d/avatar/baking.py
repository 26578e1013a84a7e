"""From a trained head and its capture to a bundle."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from ico3d.avatar import comparison, staging
from ico3d.avatar.bake_head import MAX_RANK, BakeSettings, HeadBaker, megabytes_per_10k
from ico3d.avatar.importance import logit_importance
from ico3d.avatar.render_bundle import baked_gaussians
from ico3d.bundle.format import HEAD, LICENSES, POSES, SPEECH, THUMBNAIL, write_bundle
from ico3d.bundle.head import BakedHead, poses_to_bytes
from ico3d.bundle.manifest import (
    HeadInfo,
    Loss,
    Manifest,
    Persona,
    SpeechInfo,
)
from ico3d.capture.capture import Capture
from ico3d.common.expression import EYE_NAMES, SPEECH_SIZE
from ico3d.errors import BundleError
from ico3d.head.expressions import FEATURE_RATE
from ico3d.head.trained import TrainedHead
from ico3d.head.views import view_of
from ico3d.speech.encoder import load_encoder
from ico3d.speech.export import export_speech
from ico3d.speech.network import SpeechAdaptor

RANKS = (16, 20, 24, 28, MAX_RANK)
"""Tried in this order. Not fewer: means over views would not notice that rare blinks are lost."""
MAX_MEGABYTES = 1.7
"""MB of head.safetensors per 10,000 Gaussians, at most."""
_PROBES = 32
MEASURED_VIEWS = 40

Report = Callable[[str], None]


@dataclass(frozen=True)
class BakedResult:
    """A baked head and what it costs."""

    head: BakedHead
    loss: Loss
    megabytes: float

    @property
    def acceptable(self) -> bool:
        """Whether it is within the bounds of loss and size."""
        return comparison.acceptable(self.loss) and self.megabytes <= MAX_MEGABYTES

    def __str__(self) -> str:
        """One line for people."""
        loss = self.loss
        return (
            f"rank {self.head.rank}: {loss.psnr_exact:.2f} dB exact, {loss.psnr_baked:.2f} dB "
            f"baked, {loss.psnr_baked_vs_exact:.2f} dB baked against exact, "
            f"{self.megabytes:.2f} MB per 10,000 of {self.head.num_gaussians} Gaussians"
        )


def bake(
    head: TrainedHead,
    views: list[comparison.Reference],
    capture: Capture,
    rank: int | None,
    report: Report,
    settings: BakeSettings | None = None,
) -> BakedResult:
    """Bakes with the given rank, or with the smallest that keeps the bounds (else the best).

    Args:
        head: The exact head.
        views: What to measure with.
        capture: Whose training frames give the expressions.
        rank: K, or None to choose.
        report: Is told each result.
        settings: Of the fit; the usual ones where None.
    """
    report("sampling the exact head …")
    recorded, importance = training_expressions(head, capture), importance_of(head, capture)
    baker = HeadBaker(
        head.model, recorded, importance, rank or MAX_RANK, settings or BakeSettings()
    )
    results = []
    for candidate in (rank,) if rank else RANKS:
        baked = baker.baked(candidate)
        result = BakedResult(baked, comparison.measure(baked, views), megabytes_per_10k(baked))
        report(str(result))
        if result.acceptable:
            return result
        results.append(result)
    within = [result for result in results if result.megabytes <= MAX_MEGABYTES]
    return max(within or results, key=lambda result: result.loss.psnr_baked or 0)


def check(result: BakedResult) -> None:
    """Refuses a result that breaks a bound.

    Raises:
        BundleError: With what was measured.
    """
    if not result.acceptable:
        raise BundleError(
            f"baking costs too much ({result}; allowed are {comparison.MAX_DROP} dB lost, at least "
            f"{comparison.MIN_LIKENESS:g} dB against exact, {MAX_MEGABYTES} MB): train longer, or "
            "use --force."
        )


def write(
    out: Path,
    name: str,
    result: BakedResult,
    head: TrainedHead,
    capture: Capture,
    persona: Persona,
    notices: str,
) -> Manifest:
    """Gathers everything else that a bundle holds, and writes it.

    Args:
        out: The file to write.
        name: The avatar's name.
        result: The baked head and its loss.
        head: The exact head, for its speech adaptor.
        capture: For motion, camera, background and provenance.
        persona: Who the avatar is.
        notices: Text of LICENSES.txt; no such file where it is empty.
    """
    poses = staging.idle_motion(capture)
    frontal = staging.frontal_camera(capture)
    idle = _idle_expression(head, capture)
    seen = baked_gaussians(result.head, idle)
    middle = poses[len(poses) // 2]
    points = seen.means[seen.opacities > 0.1].numpy() @ middle[:3, :3].T + middle[:3, 3]
    camera = staging.visitor_view(capture.cameras[frontal], points)
    background = staging.background_colour(capture, frontal)
    files = {
        HEAD: result.head.to_bytes(),
        POSES: poses_to_bytes(poses),
        THUMBNAIL: staging.thumbnail(seen.transform(middle), camera, background),
    }
    speech = None
    if head.adaptor is not None:
        files[SPEECH], speech = _speech(head.adaptor, head.encoder)
    if notices:
        files[LICENSES] = notices.encode()
    manifest = Manifest(
        name=name,
        head=_head_info(result.head, head, idle, capture.fps, len(poses)),
        body=None,
        speech=speech,
        camera=camera,
        background=background,
        persona=persona,
        loss=result.loss,
        provenance=staging.provenance(capture.provenance, str(capture.path)),
    )
    return write_bundle(out, manifest, files)


def training_expressions(head: TrainedHead, capture: Capture) -> np.ndarray:
    """(T, B) of the training frames."""
    track = head.track(capture)
    with torch.no_grad():
        return np.stack([track.at(frame).numpy() for frame in capture.split.train])


def importance_of(head: TrainedHead, capture: Capture) -> np.ndarray:
    """(N, 4) as training frames see it, from all cameras in turn."""
    frames = capture.split.train
    frames = [frames[i] for i in np.linspace(0, len(frames) - 1, _PROBES).astype(int)]
    frames = [frame for frame in frames if capture.world_from_head(frame) is not None]
    cameras = [view_of(capture, i % len(capture.cameras), f).camera for i, f in enumerate(frames)]
    track = head.track(capture)
    with torch.no_grad():
        expressions = torch.stack([track.at(frame) for frame in frames])  # (P, B)
    colour = torch.tensor(staging.background_colour(capture, 0))
    return logit_importance(head.model, expressions, cameras, colour, seed=0)


def _idle_expression(head: TrainedHead, capture: Capture) -> np.ndarray:
    """(B,) silence with open eyes; for blendshapes, the most neutral face that was recorded."""
    if head.adaptor is None:
        recorded = training_expressions(head, capture)
        return recorded[np.abs(recorded).sum(axis=1).argmin()]
    return np.concatenate([head.neutral()[: -len(EYE_NAMES)], _open_eyes(capture)])


def _open_eyes(capture: Capture) -> np.ndarray:
    """(7,) brows at their usual place, lids as open as they usually get."""
    rows = [capture.eyes(frame) for frame in capture.split.train]
    known = np.array([row for row in rows if row is not None and np.isfinite(row).all()])
    if len(known) == 0:
        return np.zeros(len(EYE_NAMES), np.float32)
    eyes = np.median(known, axis=0)
    lids = [i for i, name in enumerate(EYE_NAMES) if "Blink" in name]
    eyes[lids] = np.percentile(known[:, lids], 10, axis=0)
    return eyes.astype(np.float32)


def _speech(adaptor: SpeechAdaptor, encoder_name: str) -> tuple[bytes, SpeechInfo]:
    """`speech.onnx` and what the manifest says about it."""
    encoder = load_encoder(encoder_name)
    kind = "mel" if encoder.name == "builtin" else "features"
    info = SpeechInfo(encoder.name, encoder.sha256, FEATURE_RATE, kind)
    return export_speech(adaptor, encoder), info


def _head_info(
    baked: BakedHead, head: TrainedHead, idle: np.ndarray, fps: float, num_poses: int
) -> HeadInfo:
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
    )
