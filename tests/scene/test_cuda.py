"""Scenes are trained, and go on being trained, where CUDA is."""

import dataclasses

import pytest
import torch

from ico3d.scene.optimise import SceneTrainer
from ico3d.scene.settings import PRESETS
from ico3d.scene.train_scene import SceneJob, train_scene
from support.pretended_cuda import is_moved

SMALL = {
    "steps": 26,
    "initial_gaussians": 80,
    "max_gaussians": 120,
    "densify_from": 4,
    "densify_every": 8,
    "densify_until": 20,
    "reset_every": 12,
    "sh_every": 6,
    "checkpoint_every": 10,
}


@pytest.mark.parametrize("strategy", ["default", "mcmc"])
def test_an_interrupted_run_goes_on_there(cuda, still, tmp_path, strategy, monkeypatch):
    """To what it would have become."""
    capture = still(3)
    settings = dataclasses.replace(PRESETS["cpu", strategy], **SMALL)
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
