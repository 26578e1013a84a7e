"""What a window's Gaussians are at a time, by each motion."""

import json
import math

import numpy as np
import pytest
import torch

from ico3d.body.motion.deformation import GRID, MLP
from ico3d.body.motion.encoder import EncoderShape
from ico3d.body.motion.formulas import FREETIME, SPACETIME, Still
from ico3d.body.motion.tunable import MlpShape
from ico3d.body.motion.window_model import WindowModel, activated
from ico3d.body.opening import motion_from
from ico3d.body.planning.windows import Window
from ico3d.body.settings import settings_for
from ico3d.body.skinning.skinned import Skinned
from ico3d.body.training.prepare_window import PADDING, deformation
from support.bodies.window_parts import ENCODED, POSITIONAL, canonical

SKINNED = Skinned(("root", "arm"), (-1, 0), 3, 8, 32, True)
MOTIONS = [Still(), SPACETIME, FREETIME, ENCODED, POSITIONAL, SKINNED]


def test_activation():
    """Scales are exponentials, opacities and colours sigmoids of what is stored."""
    values = canonical()
    gaussians = activated(values, visibility=torch.full((5,), 0.5))
    torch.testing.assert_close(gaussians.scales, values["log_scales"].exp())
    torch.testing.assert_close(gaussians.opacities, 0.5 / (1 + (-values["opacity_logits"]).exp()))
    torch.testing.assert_close(gaussians.colors, 1 / (1 + (-values["color_logits"]).exp()))


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda m: m.about()["kind"])
def test_motions_survive_json(motion):
    """A file's description makes the same motion."""
    assert motion_from(json.loads(json.dumps(motion.about()))) == motion


def test_an_unknown_motion_is_refused():
    """Named, not guessed."""
    with pytest.raises(ValueError, match="'levitation'"):
        motion_from({"kind": "levitation"})


@pytest.mark.parametrize("motion", [ENCODED, POSITIONAL], ids=["encoder", "positional"])
def test_deltas_are_added_before_activation(motion):
    """With only the last biases left, every Gaussian gets Σ_m α_m b_m (paper, eq. of y)."""
    shared = {n: torch.zeros_like(v) for n, v in motion.initial(torch.Generator()).items()}
    depth, sets = motion.mlp.depth, motion.mlp.sets
    bias = torch.arange(10 * sets, dtype=torch.float32).view(sets, 10) / 20
    shared[f"{MLP}bias{depth}"] = bias
    values = canonical()
    alpha = torch.randn(5, sets, generator=torch.Generator().manual_seed(1))
    moved = WindowModel(motion, {**values, "alpha": alpha}, shared).at(0.3)
    delta = alpha @ bias  # (5, 10)
    torch.testing.assert_close(moved.means, values["means"] + delta[:, :3])
    torch.testing.assert_close(moved.quats, values["quats"] + delta[:, 3:7])
    torch.testing.assert_close(moved.scales, (values["log_scales"] + delta[:, 7:]).exp())
    torch.testing.assert_close(moved.colors, values["color_logits"].sigmoid())


def test_next_to_nothing_moves_at_the_beginning():
    """The last layer begins at a tenth."""
    shared = ENCODED.initial(torch.Generator().manual_seed(0))
    values = canonical()
    model = WindowModel(ENCODED, {**values, "alpha": torch.ones(5, 2) / 2}, shared)
    assert (model.at(0.5).means - values["means"]).abs().max() < 0.1


def test_the_encoder_sees_the_box():
    """Corners of the padded box are the ends of the planes, and beyond them nothing changes."""
    points = np.array([[-0.5, 0.0, -0.2], [0.7, 1.8, 0.3]])
    settings = settings_for("cpu", "swings++")
    motion = deformation("swings++", settings, Window(3, 9), points)
    edge = np.array(motion.half) * 2
    np.testing.assert_allclose(edge, np.ptp(points, axis=0) * (1 + 2 * PADDING))
    np.testing.assert_allclose(motion.middle, points.mean(0))
    assert motion.encoder == EncoderShape((32, 64), 7, 16) and motion.mlp.inputs == 32
    shared = motion.initial(torch.Generator().manual_seed(0))
    shared = {
        n: v + 0.1 * torch.randn_like(v) if n.startswith(GRID) else v for n, v in shared.items()
    }
    corner = torch.tensor(np.array(motion.middle) + motion.half).float()[None]
    deltas = [
        motion.deltas({**shared, "means": corner + off, "alpha": torch.ones(1, 2)}, 0.4)
        for off in (0.0, 1.0)
    ]
    torch.testing.assert_close(*deltas)


def test_baselines_differ_where_they_should():
    """SWinGS has no encoder but four layers; 4DGS an encoder but one set of weights."""
    points = np.random.default_rng(0).normal(size=(9, 3))
    swings = deformation("swings", settings_for("cpu", "swings"), Window(0, 4), points)
    assert swings.encoder is None and swings.mlp == MlpShape(4 * 13, 64, 4, 10, 2)
    fourd = deformation("4dgs", settings_for("cpu", "4dgs"), Window(0, 4), points)
    assert fourd.encoder is not None and fourd.mlp.sets == 1 and fourd.per_gaussian == ()


@pytest.mark.parametrize("formula", [SPACETIME, FREETIME], ids=["spacetime", "freetime"])
def test_formulas(formula):
    """Written out (Spacetime Gaussians; FreeTime without powers and turning)."""
    values = canonical()
    generator = torch.Generator().manual_seed(2)
    center, duration = torch.rand(5, generator=generator), torch.rand(5, generator=generator) + 0.1
    path = torch.randn(5, formula.degree, 3, generator=generator)
    turn = torch.randn(5, 4, generator=generator)
    values |= {"center": center, "log_duration": duration.log(), "path": path}
    values |= {"turn": turn} if formula.turning else {}
    gaussians = WindowModel(formula, values, {}).at(0.6)
    for i in range(5):
        dt = 0.6 - float(center[i])
        mean = values["means"][i] + sum(path[i, k] * dt ** (k + 1) for k in range(formula.degree))
        torch.testing.assert_close(gaussians.means[i], mean)
        opacity = values["opacity_logits"][i].sigmoid() * math.exp(-((dt / duration[i]) ** 2))
        torch.testing.assert_close(gaussians.opacities[i], opacity)
        turned = values["quats"][i] + (turn[i] * dt if formula.turning else 0)
        torch.testing.assert_close(gaussians.quats[i], turned)


def test_the_time_of_a_spacetime_gaussian_learns_from_its_opacity_alone():
    """dt is detached in motion and rotation."""
    values = canonical() | {"center": torch.rand(5), "log_duration": torch.zeros(5)}
    values |= {"path": torch.randn(5, 3, 3), "turn": torch.randn(5, 4)}
    values["center"].requires_grad_()
    gaussians = SPACETIME.at(values, 0.2)
    assert not gaussians.means.requires_grad and gaussians.opacities.requires_grad


def test_a_window_without_its_tensors_is_refused():
    """Named are those that it has and those that it should have."""
    with pytest.raises(ValueError, match=r"expected .*'alpha'"):
        WindowModel(ENCODED, canonical(), {})
    with pytest.raises(ValueError, match="length"):
        WindowModel(Still(), {**canonical(), "means": torch.zeros(4, 3)}, {})
