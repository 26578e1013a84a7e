"""Scenes are trained, and go on being trained, where CUDA is."""

import pytest

from ico3d.cli import main
from ico3d.scene.model_folder import TrainedScene
from ico3d.scene.optimise import SceneTrainer
from ico3d.scene.settings import settings_for
from ico3d.scene.train_scene import SceneJob, train_scene
from ico3d.splat.device import device_name
from support.captures import open_with
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


def test_the_verb_trains_there(cuda, still, tmp_path, monkeypatch, capsys):
    open_with(monkeypatch, lambda _: still(3))
    words = ["train", "static", "capture", tmp_path / "scene", "--steps", 2, "--device", "cuda"]
    words += ["--initial.gaussians", 80, "--density.max-gaussians", 120]
    assert main([*map(str, words), "--dry-run"]) == 0
    assert "memory of the GPU" in capsys.readouterr().out
    assert main([*map(str, words)]) == 0
    (made,) = TrainedScene.load(tmp_path / "scene").summary["made"]["environments"]
    assert made["device"] == device_name(cuda)
