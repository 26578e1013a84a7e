"""Trainings of windows and of whole clips in seconds."""

from ico3d.body.planning.windows import Window
from ico3d.body.settings import settings_for
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.body.training.prepare_window import begin_window
from ico3d.body.training.train_clip import BodyJob
from ico3d.body.training.views import BodyViews
from support.settings import changed

WINDOW = Window(4, 8)
NO_LAMP = {"skinning.shadow": False}
"""Looking for a lamp takes a second, and few tests are about it."""
SMALL = NO_LAMP | {
    "initial.gaussians": 250,
    "density.max_gaussians": 400,
    "steps_per_frame": 50,
    "warmup_steps": 20,
    "density.begin": 30,
    "density.every": 30,
    "encoder.space": 8,
    "mlp.width": 32,
}
TINY = NO_LAMP | {
    "windows.longest": 6,
    "windows.shortest": 3,
    "initial.gaussians": 60,
    "density.max_gaussians": 90,
    "steps_per_frame": 4,
    "warmup_steps": 4,
    "density.begin": 5,
    "density.every": 5,
    "encoder.space": 4,
    "mlp.width": 8,
    "finetune.steps": 6,
}


def trainer_of(capture, method="swings++", seed=0, window=WINDOW, **changes):
    """A trainer of the window in which the arm rises."""
    settings = changed(settings_for("cpu", method), SMALL | changes)
    begin = begin_window(
        capture, window, method, settings, lambda p: (p[:, 0] > 0.2).astype(float), seed
    )
    pictures = BodyViews(capture, window.frames, 0.1)
    return BodyTrainer(begin.model, window, pictures, method, settings, begin.extent, seed)


def job(method="swings++", seed=0, **changes):
    """A training of a few seconds."""
    return BodyJob(method, seed, changed(settings_for("cpu", method), TINY | changes))
