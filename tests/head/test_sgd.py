"""Stochastic gradient descent, with which the paper says heads were trained."""

import pytest

from ico3d.head import optimise
from ico3d.head.settings import PRESETS, SGD_GAINS
from ico3d.head.train_head import HeadJob, train_head
from support.settings import changed

pytestmark = pytest.mark.slow

FEW = {
    "loss.perceptual": 0.0,
    "initial.gaussians": 100,
    "density.begin": 1_000,
    "network.features": 8,
    "steps": 15,
}


def test_it_moves_what_adam_moves(tiny, tmp_path, monkeypatch):
    """About as far; with the paper's rates as they are, which are Adam's, it stands still."""

    def moved(name, optimiser):
        settings = changed(PRESETS["paper"], FEW | {"optimiser": optimiser})
        job = HeadJob("blendshapes", "full", "builtin", 0, settings)
        basis = train_head(tiny, tmp_path / name, job).model.basis.detach()
        return float(basis.square().mean().sqrt())  # it begins as 0

    adam, descent = moved("adam", "adam"), moved("sgd", "sgd")
    assert 0.2 < descent / adam < 20
    monkeypatch.setattr(optimise, "SGD_GAINS", dict.fromkeys(SGD_GAINS, 1.0))
    assert moved("without", "sgd") < 1e-4 * adam
