"""The comparison of methods for bodies."""

import os
from pathlib import Path

import pytest

from ico3d.body.planning.windows import Window
from ico3d.body.settings import ONE_WINDOW, SKINNED
from ico3d.measure.methods import bench as methods
from ico3d.measure.methods.bench import Terms, Trial, mean, run_trials, summary
from ico3d.measure.methods.settings import preset
from support.bodies.moving_capture import FRAMES, MovingCapture
from support.captures import open_with
from support.made_trial import MadeTrial
from support.settings import changed

pytestmark = pytest.mark.slow

METHODS = ("swings++", "swings", "4dgs", "spacetime", "freetime", "static")
WINDOWS = (Window(0, 13), Window(13, 26), Window(26, 40))


@pytest.mark.parametrize(
    "changes", [{}, {"steps_per_frame": 0, "steps": 700, "density.max_gaussians": 50}]
)
def test_all_have_the_same_gaussians_and_steps(changes):
    ours = changed(preset("swings++"), changes)
    terms = Terms(Path("c"), None, Path("f"), WINDOWS, ours, finetune=False)
    totals = set()
    for method in METHODS:
        settings = terms.settings(method)
        assert settings.initial.source == "hull" and settings.finetune.steps == 0
        windows = (Window(0, 40),) if method in ONE_WINDOW else WINDOWS
        steps = sum(settings.steps_of(len(window)) for window in windows)
        count, first = settings.density.max_gaussians, settings.initial.gaussians
        totals.add((steps, len(windows) * count, len(windows) * first))
    assert len(totals) == 1
    most = changes.get("density.max_gaussians", 7_000)
    assert terms.settings("static").density.max_gaussians == most
    assert terms.settings("swings").mlp.depth > terms.settings("swings++").mlp.depth


@pytest.mark.parametrize("changes", [{}, {"steps": 700}, {"steps_per_frame": 20}])
def test_a_skeleton_has_as_many_steps_but_the_gaussians_of_one_window(changes):
    ours = changed(preset("swings++"), changes | {"density.max_gaussians": 500})
    terms = Terms(Path("c"), None, Path("f"), WINDOWS, ours, finetune=False)
    for method in SKINNED:
        settings = terms.settings(method)
        assert settings.steps_of(41) == sum(ours.steps_of(len(window)) for window in WINDOWS)
        assert settings.density.max_gaussians == 500 and settings.initial.gaussians == 4_000
        assert settings.finetune.steps == 0


def test_one_window_can_draw_as_many_gaussians_as_one_of_many_does():
    """Then all methods have equally many in a picture, and as many steps as before."""
    terms = Terms(
        Path("c"), None, Path("f"), WINDOWS, preset("swings++"), finetune=False, equal_drawn=True
    )
    for method in METHODS:
        assert terms.settings(method).density.max_gaussians == 7_000
        assert terms.settings(method).initial.gaussians == 4_000
    assert terms.settings("4dgs").steps == 3 * 2_150


def test_only_swings_plus_plus_is_fine_tuned_and_elsewhere_than_without():
    terms = Terms(Path("c"), None, Path("f"), WINDOWS, preset("swings++"), finetune=True)
    tuned = {method for method in METHODS if terms.settings(method).finetune.steps}
    assert tuned == {"swings++"}
    assert Trial("swings++", 2, terms).folder == Path("f/swings++-tuned-seed2")
    assert Trial("swings", 0, terms).folder == Path("f/swings-seed0")


def _result(seed, value, moving=None, **more) -> dict:
    figures = {"seed": seed, "psnr_mask": value, "psnr_moving": moving, "flicker": None}
    lists = {"psnr_mask_per_window": [value, value + 1], "psnr_moving_per_window": [None, moving]}
    return figures | lists | more


def test_means_and_margins_in_closed_form():
    ours = [_result(0, 25.0, 20.0), _result(1, 26.0, 22.0)]
    assert mean(ours) == {
        "psnr_mask": 25.5,
        "psnr_moving": 21.0,
        "flicker": None,
        "psnr_mask_per_window": [25.5, 26.5],
        "psnr_moving_per_window": [None, 21.0],
    }
    figures = summary({"static": [_result(0, 20.0)], "swings++": ours})
    assert figures["swings++"] == {"mean": mean(ours), "seeds": ours}
    assert figures["margins"] == {
        "static": {
            "psnr_mask": 5.5,
            "psnr_moving": None,
            "psnr_mask_per_window": [5.5, 5.5],
            "psnr_moving_per_window": [None, None],
        }
    }
    assert "finetune" not in figures and "margins" not in summary({"static": [_result(0, 1.0)]})


def test_fine_tuning_is_told_before_and_after():
    tuned = [_result(s, 25.0 + s, tuned=_result(s, 24.0 + s)) for s in (0, 1)]
    figures = summary({"swings++": tuned})
    assert figures["finetune"]["before"]["psnr_mask"] == 25.5
    assert figures["finetune"]["after"]["psnr_mask"] == 24.5
    assert figures["swings++"]["mean"]["psnr_mask"] == 25.5


def test_a_clip_of_a_capture(monkeypatch):
    open_with(monkeypatch, MovingCapture)
    clip = methods.open_clip(Path("c"), 5)
    assert clip.num_frames == 5 and clip.split.train == (0, 1, 2, 3, 4)
    assert clip.split.test_cameras == MovingCapture(Path("c")).split.test_cameras
    assert methods.open_clip(Path("c"), 500).num_frames == FRAMES


def test_several_at_a_time_share_the_cores(tmp_path, monkeypatch, two_threads):
    monkeypatch.setattr(os, "cpu_count", lambda: 5)
    trials = [MadeTrial(m, s, tmp_path / f"{m}{s}") for s in (1, 0) for m in ("a", "b")]
    seen = []
    found = run_trials(trials, 2, lambda trial, result: seen.append((trial.method, result["seed"])))
    assert sorted(seen) == [("a", 0), ("a", 1), ("b", 0), ("b", 1)]
    assert {method: [r["seed"] for r in some] for method, some in found.items()} == {
        "a": [0, 1],
        "b": [0, 1],
    }
    assert all(r["threads"] == [2, 2] for some in found.values() for r in some)
    assert (tmp_path / "b1" / "log.txt").read_text() == "here is b 1\n"


def test_a_trial_that_fails_ends_the_bench(tmp_path, two_threads):
    trials = [MadeTrial("broken", 0, tmp_path / "0")]
    with pytest.raises(RuntimeError, match="broken"):
        run_trials(trials, 2, lambda *_: None)
