"""From a capture to a model folder: sets up, trains, saves."""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ico3d.capture.capture import Capture
from ico3d.common.device import DeviceName
from ico3d.scene.model_folder import TrainedScene
from ico3d.scene.optimise import SceneTrainer
from ico3d.scene.settings import SceneSettings, StrategyName
from ico3d.scene.surface_points import initial_scene
from ico3d.scene.views import Frames, Only, SceneViews
from ico3d.splat.device import computing_device
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.run import RunFolder


@dataclass(frozen=True)
class SceneJob:
    """What to train.

    Attributes:
        only: The whole picture, the person cut out, or everything else.
        frames: All frames, or the number of one.
        strategy: Density control.
        seed: All randomness follows from it.
        settings: How to train.
    """

    only: Only
    frames: Frames
    strategy: StrategyName
    seed: int
    settings: SceneSettings


def train_scene(
    capture: Capture, folder: Path, job: SceneJob, device: DeviceName = "auto"
) -> TrainedScene:
    """Trains a static scene, or goes on with an interrupted run of the same settings.

    Args:
        capture: Where the pictures come from.
        folder: Model folder; also holds metrics and checkpoints.
        job: Which part of the pictures, which frames, seed and settings.
        device: Where to compute; a run may go on elsewhere.

    Returns:
        The trained scene, as the folder now holds it.

    Raises:
        CaptureError: If the capture lacks something that is needed.
        SettingsError: If the folder holds a run with other settings, or CUDA does not work.
        ModelError: If training diverges.
    """
    run = RunFolder(folder, {"capture": str(capture.path.resolve()), **asdict(job)})
    if run.finished() is not None:
        return TrainedScene.load(folder)
    place = computing_device(device)
    settings = job.settings
    views = SceneViews(capture, job.only, job.frames, settings.cache_gib)
    start = initial_scene(capture, views, settings, np.random.default_rng(job.seed))
    start.scene.to(place)
    trainer = SceneTrainer(start, views, job.strategy, settings, job.seed)
    loop = LoopSettings(settings.steps, checkpoint_every=settings.checkpoint_every, label="scene")
    seconds = run_loop(trainer, run, loop)
    summary = {
        "train_seconds": seconds,
        "capture": capture.provenance,
        "strategy": job.strategy,
        "settings": asdict(settings),
    }
    scene = TrainedScene(trainer.scene, job.only, job.frames, views.space, summary)
    scene.save(folder)
    run.finish({"train_seconds": seconds, "num_gaussians": len(trainer.scene)})
    return scene
