"""Compares SWinGS++ with other methods: on one recording, with equally many Gaussians and steps."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ico3d.body.model_folder import UNTUNED, TrainedBody
from ico3d.body.planning.flow import copy_cache
from ico3d.body.planning.windows import Window
from ico3d.body.settings import ONE_WINDOW, SKINNED, BodySettings, Method
from ico3d.body.training.train_clip import BodyJob, plan_windows, train_body
from ico3d.capture.capture import Capture, all_frames
from ico3d.capture.formats import open_capture
from ico3d.common.device import DeviceName
from ico3d.common.presets import PresetName
from ico3d.errors import SettingsError
from ico3d.measure.body import evaluate_body
from ico3d.measure.methods.settings import OURS, changed_alike
from ico3d.measure.methods.unseen import unseen_scores
from ico3d.splat.device import computing_device
from ico3d.training.processes import fork_server

SCORES = (
    *("psnr_mask", "psnr_moving", "psnr", "ssim", "lpips"),
    *("flicker", "num_gaussians", "train_seconds"),
)
"""Metrics of a trial that are kept; docs/measuring.md defines them."""
PER_WINDOW = ("psnr_mask", "psnr_moving")
"""Metrics that are also kept for each window."""


@dataclass(frozen=True)
class Terms:
    """What all trials have in common.

    Attributes:
        capture: Path of the recording.
        frames: Number of first frames that are used; None for all.
        folder: Folder of the trainings; finished ones are not repeated.
        windows: Windows in which SWinGS++ is trained, and for which all methods are measured.
        ours: Settings of SWinGS++; where they differ from its preset, those of all methods do.
        finetune: Whether SWinGS++ is fine-tuned in the end.
        device: Where to compute.
        unseen: Whether frames after the trained ones are measured, too.
        preset: The preset from which all methods' settings come.
        equal_drawn: Whether a method of one window has only as many Gaussians as SWinGS++ has in
            one window, so that all draw equally many per picture.
    """

    capture: Path
    frames: int | None
    folder: Path
    windows: tuple[Window, ...]
    ours: BodySettings
    finetune: bool
    device: DeviceName = "auto"
    unseen: bool = False
    preset: PresetName = "cpu"
    equal_drawn: bool = False

    def settings(self, method: Method) -> BodySettings:
        """The settings of a method.

        A method that takes the clip as one window gets the steps of all windows together and the
        Gaussians of all windows together; on a skeleton, or with `equal_drawn`, it gets those of
        one window.
        """
        settings = changed_alike(method, self.ours, self.preset)
        if not (self.finetune and method == OURS):
            settings = settings.without_finetuning()
        if method not in ONE_WINDOW:
            return settings
        count = 1 if self.equal_drawn or method in SKINNED else len(self.windows)
        initial, density = settings.initial, settings.density
        return replace(
            settings,
            initial=replace(initial, gaussians=count * initial.gaussians),
            density=replace(density, max_gaussians=count * density.max_gaussians),
            steps=sum(self.ours.steps_of(len(window)) for window in self.windows),
            steps_per_frame=0,
        )


@dataclass(frozen=True)
class Trial:
    """One training and its measurement.

    Attributes:
        method: How Gaussians are moved.
        seed: Seed of the training.
        terms: What all trials have in common.
    """

    method: Method
    seed: int
    terms: Terms

    @property
    def folder(self) -> Path:
        """Model folder of this training."""
        tuned = "-tuned" if self.terms.settings(self.method).finetune.steps else ""
        return self.terms.folder / f"{self.method}{tuned}-seed{self.seed}"

    def run(self) -> dict:
        """Trains, or continues an interrupted training, and measures.

        Returns:
            `seed`; the metrics of `SCORES`; each of `PER_WINDOW` as a list `…_per_window`; if
            `Terms.unseen`, `unseen_psnr_mask` and `unseen_psnr_moving` of frames after the trained
            ones; with fine-tuning, `tuned`, which holds these metrics after it, while the others
            are from before.
        """
        capture = open_clip(self.terms.capture, self.terms.frames)
        settings, device = self.terms.settings(self.method), self.terms.device
        job = BodyJob(self.method, self.seed, settings, device=device)
        # Optical flow is the same for all trials, and was measured when the windows were cut.
        copy_cache(self.terms.folder / "flow", self.folder / "flow")
        body = train_body(capture, self.folder, job)
        if not os.path.isfile(self.folder / UNTUNED):
            return {"seed": self.seed} | self._scores(body, capture)
        before = self._scores(TrainedBody.load(self.folder, UNTUNED), capture)
        return {"seed": self.seed} | before | {"tuned": self._scores(body, capture)}

    def line(self, result: dict) -> str:
        """One line about the trial's result."""
        return (
            f"{self.method}, seed {self.seed}: PSNR-M {result['psnr_mask']:.2f} dB, "
            f"{result['train_seconds']:.0f} s"
        )

    def _scores(self, body: TrainedBody, capture: Capture) -> dict:
        body.to(computing_device(self.terms.device))
        found = evaluate_body(body, capture, spans=self.terms.windows)
        lists = {
            f"{name}_per_window": [entry[name] for entry in found["per_window"]]
            for name in PER_WINDOW
        }
        scores = {name: found[name] for name in SCORES} | lists
        if self.terms.unseen:
            whole = open_capture(self.terms.capture)
            scores |= unseen_scores(body, whole, capture.num_frames)
        return scores


def open_clip(path: Path, frames: int | None) -> Capture:
    """Opens a capture, limited to its first `frames` frames unless that is None."""
    capture = open_capture(path)
    if frames is not None and frames < capture.num_frames:
        track = capture.body_track()
        capture.body_track = lambda: track and track.until(frames)  # type: ignore[method-assign]
        capture.num_frames = frames
        capture.split = all_frames(frames, capture.cameras)
    return capture


def terms_for(
    capture: Path,
    frames: int | None,
    folder: Path,
    settings: BodySettings,
    finetune: bool,
    device: DeviceName = "auto",
    unseen: bool = False,
    preset: PresetName = "cpu",
) -> Terms:
    """Cuts the clip into windows, once for all trials, and makes the terms.

    Args:
        capture: Path of the recording.
        frames: Number of first frames that are used; None for all.
        folder: Folder under which trainings lie.
        settings: Settings of SWinGS++.
        finetune: Whether SWinGS++ is fine-tuned in the end.
        device: Where to compute.
        unseen: Whether frames after the trained ones are measured, too.
        preset: The preset from which `settings` come.

    Raises:
        SettingsError: If unseen frames are asked for and there are none.
    """
    if unseen and (frames is None or frames >= open_capture(capture).num_frames):
        raise SettingsError(f"--unseen needs --frames N, fewer than {capture} has.")
    clip = open_clip(capture, frames)
    named = folder / (f"{clip.num_frames}-frames")
    job = BodyJob(OURS, 0, settings, device=device)
    windows = plan_windows(clip, job, named).windows
    return Terms(capture, frames, named, windows, settings, finetune, device, unseen, preset)


def run_trials(
    trials: Sequence[Trial], jobs: int, done: Callable[[Trial, dict], None]
) -> dict[Method, list[dict]]:
    """Runs trials, one after another or in several processes.

    Args:
        trials: The trials to run.
        jobs: Number of processes; with more than one, each trial's output goes to `log.txt` in its
            folder.
        done: Called with each trial and its result as soon as it ends.

    Returns:
        Results for each method, by ascending seed.
    """
    found: dict[Method, list[dict]] = {}
    for trial, result in _one_by_one(trials) if jobs == 1 else _at_a_time(trials, jobs):
        done(trial, result)
        found.setdefault(trial.method, []).append(result)
    return {method: sorted(some, key=lambda r: r["seed"]) for method, some in found.items()}


def _one_by_one(trials: Sequence[Trial]) -> Iterator[tuple[Trial, dict]]:
    for trial in trials:
        yield trial, trial.run()


def _at_a_time(trials: Sequence[Trial], jobs: int) -> Iterator[tuple[Trial, dict]]:
    """Runs trials in several processes; after an error, no further trial is started."""
    threads = max(1, (os.cpu_count() or 1) // jobs)
    with ProcessPoolExecutor(jobs, fork_server(__name__), _share, (threads,)) as pool:
        futures = {pool.submit(_logged, trial): trial for trial in trials}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _share(threads: int) -> None:
    """Limits torch and numba in this process to a number of threads."""
    import torch

    from ico3d.common.native.jit import numba

    torch.set_num_threads(threads)
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))  # type: ignore (set at run time)


def _logged(trial: Trial) -> dict:
    trial.folder.mkdir(parents=True, exist_ok=True)
    path = trial.folder / "log.txt"
    if os.path.islink(path):
        path.unlink()
    with path.open("a") as log, redirect_stdout(log), redirect_stderr(log):
        return trial.run()


def summary(found: dict[Method, list[dict]]) -> dict:
    """Figures of a comparison of methods.

    Args:
        found: Results by method, from `run_trials`.

    Returns:
        For each method, `seeds` (its results) and `mean` (means over seeds; of lists, value by
        value). `margins`: for each other method the difference of means, SWinGS++ less that method.
        `finetune`: means `before` and `after`, if SWinGS++ was fine-tuned. Values that were not
        measured are None.
    """
    means = {method: mean(results) for method, results in found.items()}
    figures: dict = {
        method: {"mean": means[method], "seeds": results} for method, results in found.items()
    }
    if OURS in means:
        others = [method for method in means if method != OURS]
        names = (*PER_WINDOW, *(f"{name}_per_window" for name in PER_WINDOW))
        figures["margins"] = {
            other: {name: _above(means[OURS][name], means[other][name]) for name in names}
            for other in others
        }
    tuned = [result for result in found.get(OURS, []) if "tuned" in result]
    if tuned:
        figures["finetune"] = {"before": mean(tuned), "after": mean([r["tuned"] for r in tuned])}
    return figures


def mean(results: Sequence[dict]) -> dict:
    """Means of the metrics over results; of lists, value by value; None values are left out."""
    names = [name for name in results[0] if name not in ("seed", "tuned")]
    found = {}
    for name in names:
        values = [result[name] for result in results]
        if isinstance(values[0], list):
            found[name] = [_mean(column) for column in zip(*values, strict=True)]
        else:
            found[name] = _mean(values)
    return found


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _above(ours, theirs):
    """Difference of two numbers, or of two lists value by value; None where one is None."""
    if isinstance(ours, list):
        return [_above(a, b) for a, b in zip(ours, theirs, strict=True)]
    return None if ours is None or theirs is None else ours - theirs
