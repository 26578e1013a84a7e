"""Training a window."""

from functools import cache

import numpy as np
import pytest
import torch

from ico3d.body.settings import settings_for
from ico3d.body.training.picture_step import Learner
from ico3d.body.training.views import BodyViews
from ico3d.errors import ModelError
from ico3d.splat.losses import ssim
from ico3d.splat.render import render
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.run import BEFORE, RunFolder
from support.bodies.moving_capture import MovingCapture
from support.bodies.tiny_training import WINDOW, trainer_of
from support.bodies.tracked_capture import TrackedCapture


@pytest.fixture
def capture(tmp_path):
    """The swinging arm."""
    return MovingCapture(tmp_path)


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    """Errors at a window's ends before and after its training, and how many Gaussians it has.

    By method; each is trained when a test asks for it first.
    """
    capture = MovingCapture(tmp_path_factory.mktemp("capture"))

    @cache
    def errors(method):
        trainer = trainer_of(capture, method)
        before = ends_error(capture, trainer.model)
        for index in range(200):
            trainer.step(index)
        return before, ends_error(capture, trainer.model), len(trainer.model)

    return errors


def masked_error(capture, model, frame):
    """Mean squared error on the person, over the held-out cameras."""
    errors = []
    for index in capture.split.test_cameras:
        plate = torch.from_numpy(capture.background(index))
        with torch.no_grad():
            seen = render(model.at(WINDOW.tau(frame)), [capture.cameras[index]], plate).rgb[0]
        mask = capture.mask(index, frame)[..., None]
        errors.append(((seen.numpy() - capture.image(index, frame)) ** 2 * mask).sum() / mask.sum())
    return np.mean(errors) / 3


def ends_error(capture, model):
    """The sum of errors at both ends of the window."""
    return masked_error(capture, model, 4) + masked_error(capture, model, 8)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["swings++", "swings", "4dgs", "spacetime", "freetime"])
def test_every_method_learns(learned, method):
    """The error at the window's ends falls, with fewer Gaussians than allowed."""
    before, after, count = learned(method)
    assert count <= 400
    assert after < 0.9 * before


@pytest.mark.slow
def test_what_moves_is_learned(learned):
    """SWinGS++ is nearer to the truth than Gaussians that stand still."""
    moving, still = (learned(method)[1] for method in ("swings++", "static"))
    assert moving < 0.7 * still


def test_the_warm_up_moves_nothing(capture):
    """Only canonical Gaussians learn, and only from the centre frame."""
    trainer = trainer_of(capture)
    before = {name: value.clone() for name, value in trainer.model.shared.items()}
    alpha, means = (trainer.model.gaussians[n].clone() for n in ("alpha", "means"))
    for index in range(20):
        trainer.step(index)
    assert all(torch.equal(before[n], value) for n, value in trainer.model.shared.items())
    assert torch.equal(alpha, trainer.model.gaussians["alpha"])
    assert not torch.equal(means, trainer.model.gaussians["means"])
    trainer.step(20)
    assert not torch.equal(before["mlp.weight2"], trainer.model.shared["mlp.weight2"])


def test_a_frame_that_joins_begins_where_its_neighbour_is(capture):
    """Its rows of the time planes are those of the frame nearer to the middle, then learn."""
    trainer = trainer_of(capture, unfolding=0.5)  # frames 4 to 8, 250 steps
    planes = trainer.model.shared
    with torch.no_grad():
        planes["grid.xt0"][1] = 3.0
    for index in range(20, 84):
        trainer._unfold(index)
    assert planes["grid.xt0"][[0, 1, 3, 4]].unique().tolist() == [1.0]  # all from the middle
    assert trainer._views(20)[0].frame in (5, 6, 7)


@pytest.mark.slow
def test_alpha_follows_density_control(capture):
    """Blending weights begin as the flow's mask and are cloned along with their Gaussians."""
    trainer = trainer_of(capture)
    alpha = trainer.model.gaussians["alpha"].detach()
    moving = trainer.model.gaussians["means"][:, 0] > 0.2
    torch.testing.assert_close(alpha, torch.stack([~moving, moving], 1).float())
    for index in range(100):
        trainer.step(index)
    assert len(trainer.model) > 250 and len(trainer.model.gaussians["alpha"]) == len(trainer.model)


@pytest.mark.parametrize("squares", [0.0, 3.0])
def test_the_loss_is_the_papers_and_squares(capture, squares):
    """λ_1·L1 + λ_s·(1 − SSIM) + λ_m·|M_r − M_gt|, and squared differences where they count."""
    trainer = trainer_of(capture, **{"loss.squares": squares})
    learner = trainer._learner
    view = learner.views[3]
    example = learner.example(view, 0)
    rendering = learner.draw(trainer.model.canonical(), view, example)
    image, target = rendering.rgb, example.target[None]
    expected = (
        0.8 * (image - target).abs().mean()
        + 0.2 * (1 - ssim(image, target))
        + 0.1 * (rendering.alpha[0] - example.mask).abs().mean()
        + squares * (image - target).square().mean()
    )
    torch.testing.assert_close(learner.loss(rendering, example), expected)


@pytest.mark.parametrize("method", ["swings++", "freetime"])
def test_resuming_repeats_the_uninterrupted_run(capture, method):
    """Bit by bit, density control included."""
    whole = trainer_of(capture, method)
    for index in range(40):
        whole.step(index)
    kept = {name: value.detach().clone() for name, value in whole.tensors().items()}
    resumed = trainer_of(capture, method)
    resumed.restore(kept, {})
    for index in range(40, 65):
        whole.step(index)
        resumed.step(index)
    for name, value in whole.tensors().items():
        assert torch.equal(value, resumed.tensors()[name]), name


@pytest.mark.slow
def test_cameras_that_see_other_colors_are_corrected(capture):
    """A camera whose pictures are darker by a fifth learns that factor, not the Gaussians."""
    picture, plate = capture.image, capture.background
    capture.image = lambda c, f: picture(c, f) * (0.8 if c == 1 else 1.0)
    capture.background = lambda c: plate(c) * (0.8 if c == 1 else 1.0)
    trainer = trainer_of(capture, color_correction=True, **{"rates.motion": 2e-2})
    for index in range(160):
        trainer.step(index)
    maps = trainer.model.camera_colors.detach()
    grey = (maps @ torch.tensor([0.5, 0.5, 0.5, 1.0])).mean(1)  # (C,)
    assert grey[1] / grey[[0, 2]].mean() == pytest.approx(0.8, abs=0.06)
    learnt = sorted({view.camera_index for view in trainer._learner.views})
    assert set(capture.split.test_cameras).isdisjoint(learnt)
    torch.testing.assert_close(maps[learnt].mean(0), torch.eye(3, 4), rtol=0, atol=1e-6)


def test_epochs_show_every_view_once(capture):
    """In another order each time."""
    learner = Learner(
        trainer_of(capture).model,
        WINDOW,
        BodyViews(capture, WINDOW.frames, 0.1),
        settings_for("cpu", "swings++"),
        1.0,
        0,
    )
    count = len(learner.views)
    seen = [learner.view(learner.views, index) for index in range(2 * count)]
    assert (
        {id(v) for v in seen[:count]}
        == {id(v) for v in seen[count:]}
        == {id(v) for v in learner.views}
    )
    assert seen[:count] != seen[count:]


FOREIGN = {
    "gaussians.skin_joints": lambda tensor: torch.full_like(tensor, 2**30),
    "gaussians.means": lambda tensor: tensor[:, :1].contiguous(),
    "shared.pose_rotations": lambda tensor: tensor[:1].contiguous(),
    "moments.means.first": lambda tensor: tensor[:1].contiguous(),
    "moments.means.second": torch.Tensor.double,
    "moments.means.steps": lambda tensor: tensor - 100,
    "camera_colors": lambda tensor: tensor[:1].contiguous(),
    "density.views": lambda tensor: torch.zeros(7),
}


def test_a_checkpoint_of_other_tensors_is_refused_before_a_kernel_writes_to_them(tmp_path):
    """The optimiser's kernel writes to moments as far as their parameter reaches."""
    capture = TrackedCapture(tmp_path / "capture")
    trainer = trainer_of(capture, "skinned", color_correction=True)
    trainer.step(0)
    honest = {name: tensor.detach().clone() for name, tensor in trainer.tensors().items()}
    state = {"step": 1, "seconds": 1.0, "trainee": {}}
    run = RunFolder(tmp_path / "run", {})
    steps = LoopSettings(steps=1)
    for name, change in FOREIGN.items():
        run.save_checkpoint(honest | {name: change(honest[name])}, state)
        (run.path / BEFORE).unlink(missing_ok=True)
        resumed = trainer_of(capture, "skinned", color_correction=True)
        with pytest.raises(ModelError, match="is of another training"):
            run_loop(resumed, run, steps)
    run.save_checkpoint(honest, state)
    run_loop(resumed, run, steps)
    assert all(torch.equal(honest[name], tensor) for name, tensor in resumed.tensors().items())
