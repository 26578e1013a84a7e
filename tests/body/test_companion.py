"""Bodies that are trained with somebody else in the picture."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch

from ico3d.body.companion import MOMENTS, PRUNE_EVERY, Pruning
from ico3d.body.motion.formulas import FREETIME, Still
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.windows import Window
from ico3d.body.settings import settings_for
from ico3d.body.training.finetune_window import FineTuner
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.body.training.prepare_window import begin_window, continued_window
from ico3d.body.training.train_clip import BodyJob, train_body
from ico3d.body.training.views import BodyViews
from ico3d.errors import ModelError, SettingsError
from ico3d.splat.density import Population
from ico3d.splat.gaussians import Gaussians, cat
from ico3d.splat.render import render
from support.bodies.moving_capture import FRAMES, MovingCapture
from support.bodies.tiny_training import SMALL, WINDOW
from support.bodies.window_parts import canonical
from support.settings import changed

pytestmark = pytest.mark.slow

RADIUS = 0.13
BALL = np.array([0.0, 0.35, 0.0])
"""The upper end of the moving capture's trunk."""


class Ball:
    """A companion: a red ball where the trunk's upper end is, with a ring about it."""

    def __init__(self, per_frame=(0.0, 0.0, 0.0), points=30):
        self._speed, self._points = np.array(per_frame), points
        self.asked: list[float] = []
        directions = np.random.default_rng(3).normal(size=(40, 3))
        self._shell = RADIUS * directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def center(self, frame):
        return BALL + frame * self._speed

    def gaussians(self, frame):
        return Gaussians(
            torch.from_numpy(self._shell + self.center(frame)).float(),
            torch.tensor([1.0, 0, 0, 0]).repeat(40, 1),
            torch.full((40, 3), 0.03),
            torch.full((40,), 0.9),
            torch.tensor([1.0, 0.1, 0.1]).repeat(40, 1),
        )

    def trespassing(self, means, frame):
        self.asked.append(frame)
        away = means - torch.from_numpy(self.center(frame)).to(means)
        return away.norm(dim=1) < RADIUS

    def border(self, frame, rng):
        turns = rng.random(self._points) * 2 * np.pi
        ring = np.stack([np.cos(turns), 0 * turns, np.sin(turns)], 1)
        return self.center(frame) + 1.2 * RADIUS * ring


@dataclass(frozen=True)
class BallSource:
    points: int = 30

    def open(self, device):
        del device
        return Ball(points=self.points)

    def about(self):
        return {"points": self.points}


@pytest.fixture
def capture(tmp_path):
    """The swinging arm."""
    return MovingCapture(tmp_path)


def trainer_of(capture, companion, **changes):
    """A trainer beside a ball."""
    settings = changed(settings_for("cpu", "swings++"), SMALL | changes)
    dynamic = lambda p: (p[:, 0] > 0.2).astype(float)  # noqa: E731
    begin = begin_window(capture, WINDOW, "swings++", settings, dynamic, 0, companion)
    views = BodyViews(capture, WINDOW.frames, 0.1)
    return BodyTrainer(begin.model, WINDOW, views, "swings++", settings, begin.extent, 0, companion)


def moving_model(ends):
    """Gaussians far away at τ = 0 that are at these places (N, 3) at τ = 1."""
    ends = torch.as_tensor(np.array(ends)).float()
    count = len(ends)
    away = torch.tensor([3.0, 0.0, 0.0])
    parts = canonical(count) | {"means": ends + away}
    parts |= {"center": torch.zeros(count), "log_duration": torch.zeros(count)}
    return WindowModel(FREETIME, parts | {"path": -away.repeat(count, 1, 1)}, {})


def random_model(count=200):
    """Gaussians that stand still, every second one in the ball."""
    parts = canonical(count)
    parts["means"] = torch.from_numpy(BALL).float() + 0.01 * parts["means"]
    parts["means"][1::2, 0] += 1.0
    return WindowModel(Still(), parts, {})


def test_deformed_positions_count():
    """Who only comes into the ball at the window's end is removed; who passes beside it is not."""
    model = moving_model([BALL, BALL + np.array([0, 2 * RADIUS, 0])])
    kept = {name: value[1:].clone() for name, value in model.gaussians.items()}
    companion = Ball()
    removed = Pruning(companion, WINDOW).carry_out(model, Population(model.gaussians, {}))
    assert removed == 1
    for name, value in model.gaussians.items():
        torch.testing.assert_close(value, kept[name])
    assert companion.asked == np.linspace(WINDOW.first, WINDOW.last, MOMENTS).tolist()


def test_the_ball_is_where_it_is_at_each_moment():
    """A ball that arrives at a Gaussian in the window's last frame removes it."""
    place = BALL + np.array([0.5, 0, 0]) * WINDOW.last
    parts = canonical(2) | {"means": torch.from_numpy(np.stack([place, place + 5])).float()}
    model = WindowModel(Still(), parts, {})
    assert Pruning(Ball((0.5, 0, 0)), WINDOW).trespassing(model).tolist() == [True, False]
    assert Pruning(Ball(), WINDOW).trespassing(model).tolist() == [False, False]


def test_moments_follow():
    """Those of the kept are theirs as before."""
    model = random_model()
    moments = {"means.first": torch.rand(200, 3), "means.second": torch.rand(200, 3)}
    expected = {name: value[1::2].clone() for name, value in moments.items()}
    assert Pruning(Ball(), WINDOW).carry_out(model, Population(model.gaussians, moments)) == 100
    assert len(model) == 100
    assert all(torch.equal(moments[name], expected[name]) for name in moments)


def test_somebody_is_left():
    """A body that is all inside is left as it is: a misplaced head shall not end the training."""
    model = random_model()
    model.gaussians["means"][1::2, 0] -= 1.0
    assert Pruning(Ball(), WINDOW).carry_out(model, Population(model.gaussians, {})) == 0
    assert len(model) == 200


def test_removal_is_due_every_hundred_steps():
    """And after the last, so that nobody is inside in the end."""
    pruning = Pruning(Ball(), WINDOW)
    assert [step for step in range(250) if pruning.due(step, 250)] == [100, 200, 249]
    assert PRUNE_EVERY == 100


def test_nothing_begins_in_the_ball_and_more_about_it(capture):
    """All begin outside, as many as before less those inside, and the border's points besides."""
    settings = changed(settings_for("cpu", "swings++"), SMALL)
    alone, beside = (
        begin_window(capture, WINDOW, "swings++", settings, lambda p: p[:, 0] > 0.2, 0, companion)
        for companion in (None, Ball())
    )
    ball = Ball()
    inside = ball.trespassing(alone.model.gaussians["means"], WINDOW.center)
    assert 5 < inside.sum() < len(alone.model)
    assert not ball.trespassing(beside.model.gaussians["means"], WINDOW.center).any()
    assert len(beside.model) == len(alone.model) - int(inside.sum()) + 30
    away = beside.model.gaussians["means"][-30:] - torch.from_numpy(BALL).float()
    torch.testing.assert_close(away.norm(dim=1), torch.full((30,), 1.2 * RADIUS))


def test_a_trained_window_begins_without_trespassers():
    """All of them are gone before the first step."""
    begin = continued_window(random_model(), WINDOW, Ball())
    assert len(begin.model) == 100
    assert len(continued_window(random_model(), WINDOW, None).model) == 200


def test_the_companion_is_in_the_picture(capture):
    """The picture is that of both together, and density control learns of the body alone."""
    ball = Ball()
    trainer = trainer_of(capture, ball)
    learner, body = trainer._learner, trainer.model.canonical()
    view = learner.views[2]
    example = learner.example(view, 0)
    seen = learner.draw(body, view, example)
    together = cat([body, ball.gaussians(view.frame)])
    expected = render(together, [view.camera], example.color).rgb
    torch.testing.assert_close(seen.rgb, expected)
    alone = render(body, [view.camera], example.color).rgb
    assert (seen.rgb - alone).abs().max() > 0.2
    learner.loss(seen, example).backward()
    whole, ours = seen.info, seen.info.first(len(body))
    assert whole.radii.shape == (1, len(body) + 40) and ours.radii.shape == (1, len(body))
    assert torch.equal(ours.screen_gradients(), whole.screen_gradients()[:, : len(body)])
    trainer.step(0)
    assert {len(t) for n, t in trainer.tensors().items() if n.startswith("density.")} == {len(body)}


def test_a_frozen_companion_does_not_learn(capture):
    """It is the same after training, and nothing of it is saved with the window."""
    ball = Ball()
    still, before = ball.gaussians(WINDOW.center), ball.gaussians(WINDOW.center)
    ball.gaussians = lambda frame: still
    trainer = trainer_of(capture, ball)
    for index in range(30):
        trainer.step(index)
    for name in ("means", "quats", "scales", "opacities", "colors"):
        value = getattr(still, name)
        assert value.grad is None and not value.requires_grad
        assert torch.equal(value, getattr(before, name))
    names = {n for n in trainer.tensors() if n.startswith("gaussians.")}
    assert {len(trainer.tensors()[n]) for n in names} == {len(trainer.model)}


def test_training_keeps_clear_of_the_ball(capture):
    """Right after a removal nothing is inside, at any moment of the window."""
    trainer = trainer_of(capture, Ball())
    for index in range(PRUNE_EVERY):
        trainer.step(index)
    trainer.model.gaussians["means"].data[:3] = torch.from_numpy(BALL).float()
    pruning = Pruning(Ball(), WINDOW)
    assert pruning.trespassing(trainer.model).sum() >= 3
    trainer.step(PRUNE_EVERY)
    assert not pruning.trespassing(trainer.model).any()


def test_resuming_repeats_the_uninterrupted_run(capture):
    """Bit by bit, across a removal that density control does not share its step with."""
    whole = trainer_of(capture, Ball())
    for index in range(95):
        whole.step(index)
    kept = {name: value.detach().clone() for name, value in whole.tensors().items()}
    resumed = trainer_of(capture, Ball())
    resumed.restore(kept, {})
    counts = set()
    for index in range(95, 125):
        whole.step(index)
        resumed.step(index)
        counts.add(len(whole.model))
    assert len(counts) > 1
    for name, value in whole.tensors().items():
        assert torch.equal(value, resumed.tensors()[name]), name


def test_fine_tuning_removes_too(capture):
    """What moves the Gaussians stays frozen through it; the companion is in both pictures."""
    ball, after = Ball(), Window(4, 8)
    models = [trainer_of(capture, ball).model for _ in range(2)]
    settings = changed(settings_for("cpu", "swings++"), SMALL | {"finetune.steps": 2 * PRUNE_EVERY})
    views, cameras = BodyViews(capture, after.frames, 0.1), list(capture.cameras)
    tuner = FineTuner(models[1], models[0], after, views, cameras, settings, 0.7, 0, ball)
    goal = tuner._goal.means[-40:]
    assert torch.equal(goal, ball.gaussians(after.first).means)
    tuner.step(PRUNE_EVERY - 1)
    models[1].gaussians["means"].data[:3] = torch.from_numpy(BALL).float()
    count = len(models[1])
    tuner.step(PRUNE_EVERY)
    assert len(models[1]) <= count - 3
    assert len(tuner.tensors()["moments.means.mean"]) == len(models[1]), "means are removed, too"
    assert not Pruning(ball, after).trespassing(models[1]).any()
    assert models[1].gaussians["means"].requires_grad
    assert not models[1].gaussians["alpha"].requires_grad


TINY = SMALL | {"windows.longest": 16, "steps_per_frame": 4, "finetune.steps": 0, "mlp.width": 8}


def job_of(method="swings++", **about):
    """A training of a moment."""
    return BodyJob(method, 0, changed(settings_for("cpu", method), TINY), **about)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A capture, and a body that was trained on it without anybody else."""
    folder = tmp_path_factory.mktemp("alone")
    capture = MovingCapture(folder / "capture")
    train_body(capture, folder / "body", job_of())
    return capture, folder / "body"


def test_a_trained_body_goes_on_with_a_companion(folders, tmp_path):
    """In the same windows, and away from the ball; another companion makes it another run."""
    capture, alone = folders
    job = job_of(companion=BallSource(), continued=alone)
    body = train_body(capture, tmp_path / "on", job)
    assert body.windows == (Window(0, FRAMES - 1),)
    assert not Ball().trespassing(body.models[0].at(0.5).means, 4).any()
    with pytest.raises(SettingsError, match=r"another 'companion\.points' \(30, not 3\)"):
        train_body(capture, tmp_path / "on", replace(job, companion=BallSource(3)))


def test_bodies_that_do_not_fit_are_refused(folders, tmp_path):
    """Of another method, or of another clip, in one sentence."""
    capture, alone = folders
    with pytest.raises(ModelError, match=r"trained with --method swings\+\+: only"):
        train_body(capture, tmp_path / "a", job_of("static", continued=alone))
    other = MovingCapture(capture.path)
    other.num_frames = FRAMES - 2
    with pytest.raises(ModelError, match=r"has 9 frames at 15 per second, .* has 7 at 15"):
        train_body(other, tmp_path / "b", job_of(continued=alone))
