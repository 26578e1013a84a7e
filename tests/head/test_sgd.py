"""Stochastic gradient descent, with which the paper says heads were trained."""

import pytest
import torch

from ico3d.head import optimise
from ico3d.head.settings import PRESETS, SGD_GAINS
from ico3d.head.train_head import HeadJob, train_head
from support.settings import changed

pytestmark = pytest.mark.slow

FEW = {"loss.perceptual": 0.0, "initial.gaussians": 200, "density.begin": 1_000}


@pytest.mark.parametrize("gains", [True, False])
def test_it_moves_what_adam_moves(gains, tiny, tmp_path, monkeypatch):
    """About as far; with rates that are Adam's, as the paper has them, it would stand still."""
    if not gains:
        monkeypatch.setattr(optimise, "SGD_GAINS", dict.fromkeys(SGD_GAINS, 1.0))
    moved = {}
    for kind in ("adam", "sgd"):
        settings = changed(PRESETS["paper"], FEW | {"optimiser": kind, "steps": 40})
        job = HeadJob("blendshapes", "full", "builtin", 0, settings)
        basis = train_head(tiny, tmp_path / kind, job).model.basis.detach()
        moved[kind] = float(basis.square().mean().sqrt())  # it begins as 0
    share = moved["sgd"] / moved["adam"]
    assert torch.isfinite(torch.tensor(share))
    assert 0.2 < share < 20 if gains else share < 1e-4
