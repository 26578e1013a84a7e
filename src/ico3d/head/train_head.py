"""Trains a head on a capture and writes the model folder."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch

from ico3d.capture.capture import Capture
from ico3d.capture.face.canonical import canonical_landmarks
from ico3d.capture.face.landmark_motion import landmark_motion
from ico3d.capture.face.lip_shapes import lip_shapes
from ico3d.capture.parts.head_of_body import head_in
from ico3d.capture.parts.held_out import training_part
from ico3d.capture.parts.trained_on import trained_on
from ico3d.capture.pictures import train_cameras
from ico3d.common.device import DeviceName
from ico3d.common.expression import EyeRange, eye_range
from ico3d.common.files import resolved
from ico3d.errors import CaptureError
from ico3d.head.blending.displacement import Displacement, principal, told
from ico3d.head.expressions import (
    FEATURE_RATE,
    BlendshapeTrack,
    ExpressionTrack,
    SpeechTrack,
    speech_features,
)
from ico3d.head.initial_gaussians import initial_head
from ico3d.head.model import HeadModel, Variant
from ico3d.head.model_folder import Inputs, TrainedHead
from ico3d.head.optimise import HeadTrainer
from ico3d.head.settings import HeadSettings
from ico3d.speech.encoder import load_encoder
from ico3d.speech.lip_reading import read_lips
from ico3d.speech.network import SpeechAdaptor
from ico3d.splat.device import computing_device
from ico3d.training.dry_run import Needs, needs_of
from ico3d.training.loop import LoopSettings, Watch, run_loop
from ico3d.training.notes.lock import lets_go
from ico3d.training.provenance import note_environment, provenance
from ico3d.training.run import RunFolder

Watched = Callable[[HeadTrainer], AbstractContextManager[Watch]]
"""Makes the observer of a training."""


@dataclass(frozen=True)
class HeadJob:
    """A head training: the options of `ico3d train head`.

    Attributes:
        inputs: What drives the head: `speech` or `blendshapes`.
        variant: The model's variant.
        encoder: Name of the speech encoder where `inputs` is `speech`.
        seed: Seed of all random numbers.
        settings: How the head is trained.
        hold_out: Whether the validation pictures are left out of the training.
        over_torso: Whether the head alone is learnt, over the recorded torso of a portrait.
    """

    inputs: Inputs
    variant: Variant
    encoder: str
    seed: int
    settings: HeadSettings
    hold_out: bool = False
    over_torso: bool = False

    def about(self, capture: Path) -> dict:
        """Values that a run must share with an interrupted one to continue it."""
        about = {"capture": str(resolved(capture)), **asdict(self)}
        for name in ("hold_out", "over_torso"):
            if not about[name]:
                del about[name]  # runs of earlier versions say nothing of it
        return about


@lets_go
def train_head(
    capture: Capture,
    folder: Path,
    job: HeadJob,
    watched: Watched | None = None,
    device: DeviceName = "auto",
) -> TrainedHead:
    """Trains a head, or continues an interrupted run of the same settings.

    Args:
        capture: The recording, with pictures, head poses and expressions. Where it shows the whole
            body, the head is cut out of its pictures, and its test cameras are left out.
        folder: The model folder, which also holds metrics and checkpoints.
        job: Inputs, variant, seed and settings.
        watched: Makes what observes the training while it lasts, such as a live page.
        device: Where to compute; a resumed run may use another device.

    Returns:
        The trained head, as the folder stores it.

    Raises:
        CaptureError: If the capture lacks something that the training needs.
        SettingsError: If the folder holds a run with other settings, or CUDA is asked for and does
            not work.
        ModelError: If training diverges.
    """
    run = RunFolder(folder, job.about(capture.path))
    if run.finished() is not None:
        return TrainedHead.load(folder)
    recording, capture = capture, head_in(training_part(capture, job.hold_out), job.over_torso)
    trainer, encoder = trainer_of(capture, job, device)
    track, adaptor = trainer.track, trainer.adaptor
    note_environment(folder, trainer.model.device)
    every = job.settings.checkpoint_every
    loop = LoopSettings(job.settings.steps, checkpoint_every=every, label="head")
    with nullcontext() if watched is None else watched(trainer) as watch:
        seconds = run_loop(trainer, run, loop, watch)
    tell_moves(trainer.model, track, trainer.seen_moves)
    names = track.names if isinstance(track, BlendshapeTrack) else ()
    summary = {
        "train_seconds": seconds,
        "capture": capture.provenance,
        "recording": trained_on(recording, train_cameras(capture), capture.split.train)
        | {"poses": trainer.poses, "over_torso": job.over_torso},
        "settings": asdict(trainer.settings),
        "made": provenance([folder], job.seed, trainer.used | {"encoder": encoder[0] or None}),
    }
    landmarks = canonical_landmarks(capture)
    eyes = _eyes(capture, track)
    head = TrainedHead(
        trainer.model, job.inputs, names, *encoder, adaptor, summary, landmarks, eyes, trainer.turn
    )
    head.save(folder)
    run.finish({"train_seconds": seconds, "num_gaussians": len(trainer.model)})
    return head


def needs_of_head(capture: Capture, job: HeadJob, device: DeviceName = "auto") -> Needs:
    """What the training of a head takes; a few steps are done, and nothing is written.

    Raises:
        Ico3dError: As for `train_head`.
    """
    trainer, _ = trainer_of(
        head_in(training_part(capture, job.hold_out), job.over_torso), job, device
    )
    settings, views = job.settings, trainer.views
    trainer.pictures.picture(views[0], trainer.model.device)  # one tells how large they are
    pictures = trainer.pictures.needs(len(views))
    most = settings.density.max_gaussians
    return needs_of(trainer, settings.steps, most, settings.steps, 1, pictures)


def trainer_of(
    capture: Capture, job: HeadJob, device: DeviceName
) -> tuple[HeadTrainer, tuple[str, str]]:
    """The trainee before its first step, and the speech encoder's name and sha256."""
    place, settings = computing_device(device), job.settings
    if capture.shows == "body":
        settings = replace(settings, loss=replace(settings.loss, torso=0.0))
    torch.manual_seed(job.seed)  # layers draw their weights
    track, adaptor, encoder = _inputs(capture, job, place)
    rng = np.random.default_rng(job.seed)
    count = 0 if job.variant == "static" else settings.displacements
    found = displacement_of(capture, count)
    model = initial_head(capture, settings, job.variant, track.size, rng, found)
    model.to(place)
    moves = {} if found is None else seen_moves(found, capture, sorted(capture.split.train))
    tell_moves(model, track, moves)
    return HeadTrainer(capture, model, track, adaptor, settings, job.seed, moves), encoder


def displacement_of(capture: Capture, count: int) -> Displacement | None:
    """The up to `count` ways in which the face moves in the training frames, by its landmarks."""
    landmarks = canonical_landmarks(capture) if count else None
    if landmarks is None:
        return None
    frames = sorted(capture.split.train)
    return principal(landmarks, landmark_motion(capture, frames, landmarks), count)


def seen_moves(
    found: Displacement, capture: Capture, frames: Sequence[int]
) -> dict[int, torch.Tensor]:
    """The coefficients (M,) of the displacements in those of the frames that show landmarks."""
    motion = landmark_motion(capture, frames, found.landmarks)  # (F, P, 3)
    rows = torch.from_numpy(found.coefficients(motion))  # (F, M)
    known = rows.isfinite().all(1).tolist()
    return {frame: row for frame, row, here in zip(frames, rows, known, strict=True) if here}


def tell_moves(model: HeadModel, track: ExpressionTrack, moves: Mapping[int, torch.Tensor]) -> None:
    """Fits what expressions tell of a head's displacements to coefficients (M,) by frame."""
    if moves:
        with torch.no_grad():
            expressions = torch.stack([track.at(frame) for frame in moves]).numpy()  # (F, B)
        basis = model.displacement_basis.detach()
        sizes = basis.norm(dim=2).square().mean(1).sqrt().clamp_min(1e-6).cpu().numpy()  # (M,)
        coefficients = torch.stack(list(moves.values())).numpy()  # (F, M)
        network = told(expressions, coefficients, sizes)
        parts = (network.w1, network.b1, network.w2, network.b2)
        for buffer, part in zip(model.move_network, parts, strict=True):
            buffer.copy_(torch.from_numpy(part))


def _eyes(capture: Capture, track: ExpressionTrack) -> EyeRange:
    """How far eyes, brows and smile move in the frames that train the head."""
    if not isinstance(track, SpeechTrack):
        return EyeRange()
    return eye_range(track.eyes[list(capture.split.train)].numpy())


def _inputs(
    capture: Capture, job: HeadJob, device: torch.device
) -> tuple[ExpressionTrack, SpeechAdaptor | None, tuple[str, str]]:
    """What drives the head; for speech the adaptor to train and the encoder's name and sha256."""
    if job.inputs == "blendshapes":
        if capture.blendshape_names is None:
            raise CaptureError(f"{capture.path} has no blendshapes: train with --inputs speech.")
        track = BlendshapeTrack(capture, capture.blendshape_names)
        for frame in capture.split.train:
            track.at(frame)  # a frame without is better found now than after an hour
        return track, None, ("", "")
    encoder = load_encoder(job.encoder)
    features = speech_features(capture, encoder, device)  # (T, D)
    adaptor = SpeechAdaptor(encoder.size, encoder.vectors)
    frames = sorted(capture.split.train)
    shapes = lip_shapes(capture, frames)
    positions = np.array(frames) / capture.fps * FEATURE_RATE  # rows of features
    if shapes is not None:
        read_lips(adaptor, features, positions, shapes)
    elif encoder.articulation is not None:  # what lips do in general is better than nothing
        weight = encoder.articulation[0].numpy()  # (5, D)
        read_lips(adaptor, features, np.arange(len(features)), features @ weight.T)
    track = SpeechTrack(capture, features, adaptor, smile=job.settings.smile)
    return track, adaptor, (encoder.name, encoder.sha256)
