"""Trains a static scene on a capture and writes the model folder."""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.common.device import DeviceName
from ico3d.common.files import resolved
from ico3d.scene.model_folder import TrainedScene
from ico3d.scene.optimise import SceneTrainer
from ico3d.scene.settings import SceneSettings, StrategyName
from ico3d.scene.surface_points import initial_scene
from ico3d.scene.views import Frames, Only, SceneViews
from ico3d.splat.device import computing_device
from ico3d.training.dry_run import Needs, needs_of
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.notes.lock import lets_go
from ico3d.training.provenance import note_environment, provenance
from ico3d.training.run import RunFolder


@dataclass(frozen=True)
class SceneJob:
    """A scene training: the options of `ico3d train static`.

    Attributes:
        only: The part of the pictures to train: all, the person, or the background.
        frames: All frames, or the number of one.
        strategy: Name of the density control.
        seed: Seed of all random numbers.
        settings: How the scene is trained.
    """

    only: Only
    frames: Frames
    strategy: StrategyName
    seed: int
    settings: SceneSettings


@lets_go
def train_scene(
    capture: Capture, folder: Path, job: SceneJob, device: DeviceName = "auto"
) -> TrainedScene:
    """Trains a static scene, or continues an interrupted run of the same settings.

    Args:
        capture: The recording.
        folder: The model folder, which also holds metrics and checkpoints.
        job: Which part of the pictures, which frames, seed and settings.
        device: Where to compute; a resumed run may use another device.

    Returns:
        The trained scene, as the folder stores it.

    Raises:
        CaptureError: If the capture lacks something that the training needs.
        SettingsError: If the folder holds a run with other settings, or CUDA is asked for and does
            not work.
        ModelError: If training diverges.
    """
    run = RunFolder(folder, {"capture": str(resolved(capture.path)), **asdict(job)})
    if run.finished() is not None:
        return TrainedScene.load(folder)
    settings = job.settings
    trainer, views = _trainer(capture, job, device)
    note_environment(folder, trainer.scene.device)
    loop = LoopSettings(settings.steps, checkpoint_every=settings.checkpoint_every, label="scene")
    seconds = run_loop(trainer, run, loop)
    summary = {
        "train_seconds": seconds,
        "capture": capture.provenance,
        "strategy": job.strategy,
        "settings": asdict(settings),
        "made": provenance([folder], job.seed, {"optimiser": "adam", "sh_degree": trainer.degree}),
    }
    scene = TrainedScene(trainer.scene, job.only, job.frames, views.space, summary)
    scene.save(folder)
    run.finish({"train_seconds": seconds, "num_gaussians": len(trainer.scene)})
    return scene


def needs_of_scene(capture: Capture, job: SceneJob, device: DeviceName = "auto") -> Needs:
    """What the training of a scene takes; a few steps are done, and nothing is written.

    Raises:
        Ico3dError: As for `train_scene`.
    """
    trainer, views = _trainer(capture, job, device)
    settings = job.settings
    views.layers(views.train[0])  # one tells how large they are
    pictures = views.needs(len(views.train))
    most = settings.density.max_gaussians
    return needs_of(trainer, settings.steps, most, settings.steps, 1, pictures)


def _trainer(
    capture: Capture, job: SceneJob, device: DeviceName
) -> tuple[SceneTrainer, SceneViews]:
    """The trainee before its first step, and the pictures it learns from."""
    settings, place = job.settings, computing_device(device)
    views = SceneViews(capture, job.only, job.frames, settings.cache_gib, settings.cache_dir)
    start = initial_scene(capture, views, settings, np.random.default_rng(job.seed))
    start.scene.to(place)
    return SceneTrainer(start, views, job.strategy, settings, job.seed), views
