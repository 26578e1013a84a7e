"""The comparison of methods for bodies."""

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from ico3d.body.planning.windows import Window
from ico3d.body.reposing import fit_poses
from ico3d.body.settings import ONE_WINDOW, SKINNED
from ico3d.capture.formats import open_capture
from ico3d.errors import SettingsError
from ico3d.measure.commands import BenchBody
from ico3d.measure.methods import bench as methods
from ico3d.measure.methods.bench import Terms, Trial, mean, run_trials, summary
from ico3d.measure.methods.settings import preset
from ico3d.studio import recording as recording_module
from ico3d.studio.picture import paint
from support.bodies.moving_capture import FRAMES, MovingCapture
from support.bodies.tracked_capture import TrackedCapture
from support.captures import open_with
from support.made_trial import MadeTrial
from support.recordings.synthetic_bodies import write_body
from support.settings import changed

pytestmark = pytest.mark.slow

METHODS = ("swings++", "swings", "4dgs", "spacetime", "freetime", "static")
WINDOWS = (Window(0, 13), Window(13, 26), Window(26, 40))
TINY = {
    "windows.longest": 6,
    "windows.shortest": 3,
    "initial.gaussians": 60,
    "density.max_gaussians": 90,
    "steps_per_frame": 3,
    "warmup_steps": 4,
    "density.begin": 5,
    "density.every": 5,
    "encoder.space": 4,
    "mlp.width": 8,
    "finetune.steps": 6,
}


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
    assert not set(SKINNED) & set(BenchBody().methods)


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


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A bench of a tiny capture, and what it found."""
    folder = tmp_path_factory.mktemp("bench")
    with pytest.MonkeyPatch.context() as patch:
        open_with(patch, MovingCapture)
        command = BenchBody(
            folder / "capture",
            folder=folder / "runs",
            methods=("swings++", "freetime", "static"),
            settings=changed(preset("swings++"), TINY),
            finetune=True,
            json=folder / "figures.json",
        )
        command.run()
        first = json.loads((folder / "figures.json").read_text())
        written = {path: path.stat().st_mtime_ns for path in folder.rglob("window.safetensors")}
        command.run()
    return folder, first, json.loads((folder / "figures.json").read_text()), written


def test_figures_of_a_bench(bench):
    _, figures, _, _ = bench
    windows = figures["windows"]
    assert windows[0][0] == 0 and windows[-1][1] == FRAMES - 1 and len(windows) > 1
    assert set(figures["margins"]) == {"freetime", "static"}
    for method in ("swings++", "freetime", "static"):
        (result,) = figures[method]["seeds"]
        assert result["psnr_mask"] == figures[method]["mean"]["psnr_mask"] > 5
        assert len(result["psnr_mask_per_window"]) == len(windows)
        assert result["num_gaussians"] <= 90 * len(windows) and result["train_seconds"] > 0
    ours, static = figures["swings++"]["mean"], figures["static"]["mean"]
    assert figures["margins"]["static"]["psnr_mask"] == pytest.approx(
        ours["psnr_mask"] - static["psnr_mask"]
    )
    assert figures["freetime"]["mean"]["flicker"] is None and static["flicker"] > 0
    after = figures["finetune"]["after"]
    assert figures["finetune"]["before"]["flicker"] == ours["flicker"] != after["flicker"]


def test_the_same_command_trains_nothing_twice(bench):
    folder, first, second, written = bench
    again = {path: path.stat().st_mtime_ns for path in folder.rglob("window.safetensors")}
    assert again == written and len(written) > 4
    assert first == second


def test_frames_that_were_not_trained(tmp_path, monkeypatch, capsys):
    """On a skeleton the body follows the track there; elsewhere it stays where it was."""
    open_with(monkeypatch, TrackedCapture)
    monkeypatch.setattr(fit_poses, "STEPS", 7)
    command = BenchBody(
        tmp_path / "capture",
        folder=tmp_path / "runs",
        methods=("static", "hugs"),
        settings=changed(preset("swings++"), TINY | {"steps_per_frame": 20}),
        frames=6,
        unseen=True,
        json=tmp_path / "figures.json",
    )
    command.run()
    figures = json.loads((tmp_path / "figures.json").read_text())
    still, hugs = (figures[method]["mean"]["unseen_psnr_mask"] for method in ("static", "hugs"))
    assert hugs > still + 0.5
    fitted = figures["hugs"]["mean"]["unseen_fitted_psnr_mask"]
    assert abs(fitted - hugs) < 3 and fitted != hugs
    assert "unseen_fitted_psnr_mask" not in figures["static"]["mean"]
    assert "frames not trained" in capsys.readouterr().out
    with pytest.raises(SettingsError, match="--unseen needs --frames"):
        replace(command, frames=None).run()


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


def test_it_needs_somebody_to_train_on(tmp_path):
    with pytest.raises(SettingsError, match="--subject"):
        BenchBody(folder=tmp_path).run()
    with pytest.raises(SettingsError, match="--seeds"):
        BenchBody(tmp_path, folder=tmp_path, seeds=0).run()


def test_the_standard_recording_is_made_once(tmp_path, monkeypatch):
    """Of the sizes that figures are quoted for; here a corner of it is recorded indeed."""
    subject, wanted = write_body(tmp_path / "tubes.npz"), []

    def record_a_corner(recording, out, workers):
        wanted.append(recording)
        small = replace(recording, cameras=2, views_per_frame=2, frames=2, size=32)
        recording_module.record(small, out, workers)

    monkeypatch.setattr(methods, "record", record_a_corner)
    monkeypatch.setattr(paint, "DIRECTIONS", 6)  # light from few directions: drawn sooner
    for _ in range(2):
        assert methods.record_standard(subject, tmp_path / "c", 1) == tmp_path / "c"
    capture = open_capture(tmp_path / "c")
    assert capture.shows_body and capture.image(1, 1).shape == (32, 20, 3)
    (recording,) = wanted
    assert (recording.cameras, recording.frames, recording.fps) == (20, 41, 15.0)
    assert (recording.views_per_frame, recording.size) == (20, 288)
    assert (recording.motion, recording.garment) == ("showcase", "none")


def test_the_standard_recording_in_a_skirt_sways(tmp_path, monkeypatch):
    wanted = []
    monkeypatch.setattr(methods, "record", lambda recording, *_: wanted.append(recording))
    methods.record_standard(tmp_path / "tubes.npz", tmp_path / "c", 1)
    methods.record_standard(tmp_path / "tubes.npz", tmp_path / "c", 1, "skirt")
    assert wanted[1] == replace(wanted[0], motion="sway", garment="skirt")
