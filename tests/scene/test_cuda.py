"""Scenes are trained, and go on being trained, where CUDA is."""

import pytest

from ico3d.scene.optimise import SceneTrainer
from ico3d.scene.settings import settings_for
from ico3d.scene.train_scene import SceneJob, needs_of_scene, train_scene
from support.pretended_cuda import assert_same_run, is_on_cuda
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
    assert is_on_cuda(resumed.scene.parameters["means"])
    assert_same_run(resumed.scene.parameters, whole.scene.parameters)


def test_a_dry_run_trains_there(cuda, still):
    job = SceneJob("person", "all", "default", 0, changed(settings_for("cpu", "default"), SMALL))
    needs = needs_of_scene(still(3), job, "cuda")
    assert needs.end.gaussians == 120 and needs.device_memory > 0
