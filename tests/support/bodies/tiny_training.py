"""Trainings of windows and of whole clips in seconds."""

from dataclasses import replace

from ico3d.body.planning.windows import Window
from ico3d.body.settings import settings_for
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.body.training.prepare_window import begin_window
from ico3d.body.training.train_clip import BodyJob
from ico3d.body.training.views import BodyViews

WINDOW = Window(4, 8)
SMALL = {
    "initial_gaussians": 250,
    "max_gaussians": 400,
    "steps_per_frame": 50,
    "warmup_steps": 20,
    "densify_from": 30,
    "densify_every": 30,
    "grid_space": 8,
    "width": 32,
}
TINY = {
    "longest_window": 6,
    "shortest_window": 3,
    "initial_gaussians": 60,
    "max_gaussians": 90,
    "steps_per_frame": 4,
    "warmup_steps": 4,
    "densify_from": 5,
    "densify_every": 5,
    "grid_space": 4,
    "width": 8,
    "finetune_steps": 6,
}


def trainer_of(capture, method="swings++", seed=0, window=WINDOW, **changes):
    """A trainer of the window in which the arm rises."""
    settings = replace(settings_for("cpu", method), **(SMALL | changes))
    begin = begin_window(
        capture, window, method, settings, lambda p: (p[:, 0] > 0.2).astype(float), seed
    )
    pictures = BodyViews(capture, window.frames, 0.1)
    return BodyTrainer(begin.model, window, pictures, method, settings, begin.extent, seed)


def job(method="swings++", seed=0, **changes):
    """A training of a few seconds."""
    return BodyJob(method, seed, replace(settings_for("cpu", method), **(TINY | changes)))
