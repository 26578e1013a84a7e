"""Temporal fine-tuning."""

from copy import deepcopy

import numpy as np
import pytest
import torch

from ico3d.body.motion.window_model import CANONICAL
from ico3d.body.planning.windows import Window
from ico3d.body.settings import settings_for
from ico3d.body.training.finetune_window import FineTuner, around
from ico3d.body.training.views import MARGIN, BodyViews
from ico3d.splat.initial import in_pictures
from ico3d.splat.render import render
from support.bodies.moving_capture import MovingCapture
from support.bodies.tiny_training import SMALL, trainer_of
from support.settings import changed

pytestmark = pytest.mark.slow

BEFORE, AFTER = Window(0, 4), Window(4, 8)


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """The swinging arm."""
    return MovingCapture(tmp_path_factory.mktemp("capture"))


@pytest.fixture(scope="module")
def trained_apart(capture):
    """Two windows."""
    trained = []
    for window, seed in ((BEFORE, 0), (AFTER, 1)):
        trainer = trainer_of(capture, seed=seed, window=window, unfolding=0.0)
        for index in range(150):
            trainer.step(index)
        trained.append(trainer.model)
    return trained


@pytest.fixture
def models(trained_apart):
    """Two windows, trained apart, to fine-tune."""
    return deepcopy(trained_apart)


def tuner_of(capture, models, consistency, **changes):
    """Fine-tuning of the second of two windows."""
    settings = changed(settings_for("cpu", "swings++"), SMALL)
    tuning = {"finetune.steps": 120, "finetune.begin": 0.0, "finetune.consistency": consistency}
    settings = changed(settings, tuning | changes)
    cameras = [c for i, c in enumerate(capture.cameras) if i not in capture.split.test_cameras]
    pictures = BodyViews(capture, AFTER.frames, 0.1)
    return FineTuner(models[1], models[0], AFTER, pictures, cameras, settings, 0.7, 0)


def difference(capture, models):
    """Mean L1 at the shared frame between both windows, held-out cameras."""
    with torch.no_grad():
        pairs = [
            [
                render(model.at(tau), [capture.cameras[i]]).rgb
                for model, tau in zip(models, (1.0, 0.0), strict=True)
            ]
            for i in capture.split.test_cameras
        ]
    return float(np.mean([(a - b).abs().mean() for a, b in pairs]))


def test_windows_grow_together(capture, models):
    """Only the later window's canonical Gaussians change, and the border is smoother for it."""
    kept = {n: v.detach().clone() for n, v in {**models[1].gaussians, **models[1].shared}.items()}
    earlier = {n: v.detach().clone() for n, v in models[0].gaussians.items()}
    before = difference(capture, models)
    tuner = tuner_of(capture, models, 0.75)
    kinds = [set(tuner.step(index)) for index in range(120)]
    changed = {
        name
        for name, value in {**models[1].gaussians, **models[1].shared}.items()
        if not torch.equal(value, kept[name])
    }
    assert changed == set(CANONICAL)
    assert all(torch.equal(value, earlier[n]) for n, value in models[0].gaussians.items())
    assert difference(capture, models) < 0.7 * before
    agreeing = np.mean(["difference" in kind for kind in kinds])
    assert agreeing == pytest.approx(0.75, abs=0.15)


def test_it_ends_with_a_mean(capture, models):
    """Of the Gaussians of the second half of the steps."""
    start = {n: v.detach().clone() for n, v in models[1].gaussians.items()}
    plain = tuner_of(capture, models, 0.75, **{"finetune.steps": 60, "finetune.mean": 0.0})
    every = []
    for index in range(60):
        plain.step(index)
        every.append(models[1].gaussians["means"].detach().clone())
    models[1].gaussians = start
    averaged = tuner_of(capture, models, 0.75, **{"finetune.steps": 60, "finetune.mean": 0.5})
    for index in range(60):
        averaged.step(index)
    found = models[1].gaussians["means"].detach()
    assert torch.allclose(found, torch.stack(every[30:]).mean(0), rtol=0, atol=1e-6)
    assert (found - every[-1]).abs().max() > 1e-4


def test_rates_begin_where_they_are_told(capture, models, monkeypatch):
    """Half-way down at first, at the end of their decay at last."""
    tuner = tuner_of(capture, models, 0.75, **{"finetune.begin": 0.5})
    learner, seen = tuner._learner, []
    monkeypatch.setattr(learner, "update", seen.append)
    for index in (0, 60, 120):
        tuner.step(index)
    assert seen == [0.5, 0.75, 1.0]


def test_maps_of_colours_are_kept_and_used(capture, models):
    """They stay what training found, and recorded pictures are compared through them."""
    maps = torch.eye(3, 4).repeat(len(capture.cameras), 1, 1)
    maps[:, 0, 0] = torch.linspace(0.5, 1.5, len(maps))
    models[1].camera_colors = maps.clone()
    tuner = tuner_of(capture, models, 0.0, color_correction=True)
    learner = tuner._learner
    view = next(view for view in learner.views if view.camera_index == 0)
    example = learner.example(view, 0)
    drawn = learner.draw(models[1].at(0.0), view, example)
    person = drawn.rgb - (1 - drawn.alpha)[..., None] * example.color
    torch.testing.assert_close(person[..., 0], 0.5 * drawn.drawing.rgb[..., 0], rtol=0, atol=1e-6)
    for index in range(10):
        tuner.step(index)
    assert torch.equal(models[1].camera_colors, maps)


def test_resuming_repeats_the_uninterrupted_run(capture, models):
    """Bit by bit."""
    start = {n: v.detach().clone() for n, v in models[1].gaussians.items()}
    whole = tuner_of(capture, models, 0.5)
    for index in range(10):
        whole.step(index)
    kept = {n: v.detach().clone() for n, v in whole.tensors().items()}
    for index in range(10, 20):
        whole.step(index)
    last = {n: v.detach().clone() for n, v in whole.tensors().items()}
    models[1].gaussians = start
    resumed = tuner_of(capture, models, 0.5)
    resumed.restore(kept, {})
    for index in range(10, 20):
        resumed.step(index)
    assert all(torch.equal(value, last[name]) for name, value in resumed.tensors().items())


def test_cameras_are_cropped_to_the_person(capture, models):
    """Every opaque Gaussian's centre lies inside, with a margin; the picture is the same there."""
    person, whole = models[0].at(1.0).detach(), capture.cameras[0].resized(288, 320)
    part = around(whole, person)
    centers = person.means[person.opacities > 0.05].numpy()
    pixels, _ = part.project(centers[in_pictures(centers, [whole])[0]])
    assert part.width < whole.width and part.height < whole.height
    assert (pixels > 0).all() and (pixels < (part.width, part.height)).all()
    assert pixels.min() >= MARGIN - 1
    left, top = (whole.intrinsics[:2, 2] - part.intrinsics[:2, 2]).astype(int)
    pictures = [render(person, [camera]).rgb[0] for camera in (whole, part)]
    cut = pictures[0][top : top + part.height, left : left + part.width]
    difference = (pictures[1] - cut).abs()  # splats beyond the edge are linearised at it
    assert difference.max() < 5e-3 and difference.mean() < 1e-5
