"""Scenes are trained, and go on being trained, where CUDA is."""

import pytest
import torch

from ico3d.scene.optimise import SceneTrainer
from ico3d.scene.settings import settings_for
from ico3d.scene.train_scene import SceneJob, train_scene
from support.pretended_cuda import is_moved
from support.settings import changed

SMALL = {
    "steps": 26,
    "initial.gaussians": 80,
    "density.max_gaussians": 120,
    "density.begin": 4,
    "density.every": 8,
    "density.until": 20,
    "density.reset_every": 12,
    "sh_every": 6,
    "checkpoint_every": 10,
}


@pytest.mark.parametrize("strategy", ["default", "mcmc"])
def test_an_interrupted_run_goes_on_there(cuda, still, tmp_path, strategy, monkeypatch):
    """To what it would have become."""
    capture = still(3)
    settings = changed(settings_for("cpu", strategy), SMALL)
    job = SceneJob("person", "all", strategy, 0, settings)
    whole = train_scene(capture, tmp_path / "whole", job)
    step = SceneTrainer.step

    def dying_step(self, index):
        if index == 15:
            raise KeyboardInterrupt
        return step(self, index)

    with monkeypatch.context() as patch:
        patch.setattr(SceneTrainer, "step", dying_step)
        with pytest.raises(KeyboardInterrupt):
            train_scene(capture, tmp_path / "parts", job)
    resumed = train_scene(capture, tmp_path / "parts", job)
    assert is_moved(resumed.scene.parameters["means"])
    for name, value in whole.scene.parameters.items():
        assert torch.equal(resumed.scene.parameters[name], value), name
