"""Bodies are trained, fine-tuned, and go on with that, where CUDA is."""

import shutil

import pytest

from ico3d.body.model_folder import TrainedBody
from ico3d.body.settings import ONE_WINDOW, SKINNED, settings_for
from ico3d.body.training.finetune_window import FineTuner
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.body.training.train_clip import BodyJob, plan_windows, train_body
from ico3d.cli import main
from ico3d.splat.device import device_name
from support.bodies.tiny_training import TINY
from support.bodies.tracked_capture import TrackedCapture
from support.captures import open_with
from support.pretended_cuda import assert_same_run
from support.settings import changed

pytestmark = pytest.mark.slow

DEATHS = {BodyTrainer: 8, FineTuner: 4}
"""Steps before which a run is interrupted."""


def _job(method: str, **changes) -> BodyJob:
    small = TINY | {"steps_per_frame": 2, "checkpoint_every": 3, "color_correction": True}
    return BodyJob(method, 0, changed(settings_for("cpu", method), small | changes))


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """Begins model folders; the plan of a clip in windows is made once for all of them.

    Gives a function of capture, job and folder.
    """
    plans = []

    def begin(capture, job, folder):
        if job.method in ONE_WINDOW:
            return folder
        if not plans:
            plans.append(tmp_path_factory.mktemp("plan"))
            plan_windows(capture, job, plans[0])
        return shutil.copytree(plans[0], folder)

    return begin


@pytest.mark.parametrize("method", ["swings++", "swings", "spacetime", "freetime", *SKINNED])
def test_an_interrupted_run_goes_on_there(cuda, begun, tmp_path, method, monkeypatch):
    """To what it would have become, in the windows and in fine-tuning them."""
    capture, job = TrackedCapture(tmp_path / "capture", 12.0), _job(method)
    whole = train_body(capture, begun(capture, job, tmp_path / "whole"), job)
    parts = begun(capture, job, tmp_path / "parts")
    for kind, death in DEATHS.items():
        step = kind.step

        def dying_step(self, index, step=step, death=death):
            if index == death:
                raise KeyboardInterrupt
            return step(self, index)

        if kind is FineTuner and len(whole.windows) == 1:
            continue
        with monkeypatch.context() as patch:
            patch.setattr(kind, "step", dying_step)
            with pytest.raises(KeyboardInterrupt):
                train_body(capture, parts, job)
    resumed = train_body(capture, parts, job)
    for ours, theirs in zip(resumed.models, whole.models, strict=True):
        assert_same_run(ours.gaussians, theirs.gaussians)


def test_the_verb_trains_there(cuda, tmp_path, monkeypatch, capsys):
    """With maps of the cameras' colours and with harmonics, as the paper's settings may have."""
    open_with(monkeypatch, lambda _: TrackedCapture(tmp_path / "capture", 12.0))
    words = ["train", "body", "capture", tmp_path / "body", "--method", "4dgs", "--device", "cuda"]
    words += ["--steps", 2, "--warmup-steps", 0, "--sh-degree", 2, "--sh-every", 1]
    words += ["--color-correction", "--encoder.space", 4, "--mlp.width", 8]
    words += ["--initial.gaussians", 60, "--density.max-gaussians", 90]
    assert main([*map(str, words), "--dry-run"]) == 0
    assert "memory of the GPU" in capsys.readouterr().out
    assert main([*map(str, words)]) == 0
    (made,) = TrainedBody.load(tmp_path / "body").summary["made"]["environments"]
    assert made["device"] == device_name(cuda)
