"""Bodies are trained, fine-tuned, and go on with that, where CUDA is."""

import pytest
import torch

from ico3d.body.settings import SKINNED, settings_for
from ico3d.body.training.finetune_window import FineTuner
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.body.training.train_clip import BodyJob, train_body
from support.bodies.tiny_training import TINY
from support.bodies.tracked_capture import TrackedCapture
from support.settings import changed

pytestmark = pytest.mark.slow

DEATHS = {BodyTrainer: 8, FineTuner: 4}
"""Steps before which a run is interrupted."""


def _job(method: str, **changes) -> BodyJob:
    small = TINY | {"steps_per_frame": 2, "checkpoint_every": 3, "color_correction": True}
    return BodyJob(method, 0, changed(settings_for("cpu", method), small | changes))


@pytest.mark.parametrize("method", ["swings++", "swings", "spacetime", "freetime", *SKINNED])
def test_an_interrupted_run_goes_on_there(cuda, tmp_path, method, monkeypatch):
    """To what it would have become, in the windows and in fine-tuning them."""
    capture = TrackedCapture(tmp_path / "capture", 12.0)
    whole = train_body(capture, tmp_path / "whole", _job(method))
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
                train_body(capture, tmp_path / "parts", _job(method))
    resumed = train_body(capture, tmp_path / "parts", _job(method))
    for ours, theirs in zip(resumed.models, whole.models, strict=True):
        for name, value in theirs.gaussians.items():
            assert torch.equal(ours.gaussians[name], value), name
