"""Models that earlier programs trained, in `golden/`: today's program draws the same Gaussians.

`head-1` is of 2026-11-21, before heads told landmarks, eyes and turns, `head-2` of 2026-11-23,
before they turned, `head-3` of 2026-11-24, before their skin moved, `head-4` of 2026-11-28;
`scene-1` is of 2026-11-21, `body-1` of 2026-11-23. The sums in `expected.json` were computed by the
programs that wrote the models.
"""

import json
from pathlib import Path

import pytest
import torch

from ico3d.avatar.models import open_model
from ico3d.body.model_folder import TrainedBody
from ico3d.head.model_folder import TrainedHead
from ico3d.scene.model_folder import TrainedScene

GOLDEN = Path(__file__).parent / "golden"
EXPECTED = json.loads((GOLDEN / "expected.json").read_text())


def gaussians_of(model):
    if isinstance(model, TrainedHead):
        return model.model(torch.tensor([0.3, 0.8]))
    return model.gaussians(0.1) if isinstance(model, TrainedBody) else model.scene.gaussians()


@pytest.mark.parametrize("name", EXPECTED)
def test_an_old_model_draws_what_it_drew(name):
    model = open_model(GOLDEN / name, TrainedHead, TrainedBody, TrainedScene)
    assert model.summary["train_seconds"] == 7.0
    with torch.no_grad():
        gaussians = gaussians_of(model)
    for tensor, value in EXPECTED[name].items():
        assert float(getattr(gaussians, tensor).double().sum()) == pytest.approx(value, abs=1e-3)


def test_every_model_there_is_expected():
    assert {path.name for path in GOLDEN.iterdir() if path.is_dir()} == set(EXPECTED)
