"""SWinGS++ and what it is compared with: the same recording, as many Gaussians, as many steps."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import copytree

import numpy as np

from ico3d.body.model_folder import UNTUNED, TrainedBody
from ico3d.body.planning.windows import Window
from ico3d.body.settings import ONE_WINDOW, SKINNED, BodySettings, Method
from ico3d.body.training.train_clip import BodyJob, plan_windows, train_body
from ico3d.capture.capture import Capture, all_frames
from ico3d.capture.formats import open_capture
from ico3d.common.device import DeviceName
from ico3d.errors import SettingsError
from ico3d.measure.body import evaluate_body
from ico3d.measure.methods.settings import OURS, changed_alike
from ico3d.measure.methods.unseen import unseen_scores
from ico3d.splat.device import computing_device
from ico3d.studio.recording import Recording, record
from ico3d.training.processes import fork_server

SCORES = ("psnr_mask", "psnr_moving", "psnr", "ssim", "flicker", "num_gaussians", "train_seconds")
"""Metrics that a trial keeps."""
PER_WINDOW = ("psnr_mask", "psnr_moving")


@dataclass(frozen=True)
class Terms:
    """What all trials have in common.

    Attributes:
        capture: Path of the recording.
        frames: Only so many of its first frames, or None for all.
        folder: Where trainings lie; a finished one is not repeated.
        windows: As SWinGS++ is trained in, and as all are reported on.
        ours: How SWinGS++ is trained; what is not as in its preset holds for every method.
        finetune: Whether SWinGS++ is fine-tuned in the end.
        device: Where to compute.
        unseen: Whether to measure the frames after these, too.
    """

    capture: Path
    frames: int | None
    folder: Path
    windows: tuple[Window, ...]
    ours: BodySettings
    finetune: bool
    device: DeviceName = "auto"
    unseen: bool = False

    def settings(self, method: Method) -> BodySettings:
        """The settings of a method.

        Where that takes the clip as one window, it has the Gaussians and steps of all windows;
        on a skeleton those of one window are enough Gaussians.
        """
        settings = changed_alike(method, self.ours)
        if not (self.finetune and method == OURS):
            settings = settings.without_finetuning()
        if method not in ONE_WINDOW:
            return settings
        count = 1 if method in SKINNED else len(self.windows)
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
    """One training and its measurement."""

    method: Method
    seed: int
    terms: Terms

    @property
    def folder(self) -> Path:
        """Where it is trained."""
        tuned = "-tuned" if self.terms.settings(self.method).finetune.steps else ""
        return self.terms.folder / f"{self.method}{tuned}-seed{self.seed}"

    def run(self) -> dict:
        """Trains, or goes on with that, and measures.

        Returns:
            `seed`, `SCORES`, each of `PER_WINDOW` as a list `…_per_window`; `tuned`: the same
            after fine-tuning, where there was one; `unseen_psnr_mask` and `unseen_psnr_moving` of
            frames after those that were trained, where that is asked for.
        """
        capture = open_clip(self.terms.capture, self.terms.frames)
        settings, device = self.terms.settings(self.method), self.terms.device
        job = BodyJob(self.method, self.seed, settings, device=device)
        # Optical flow is the same for all, and was measured to cut the windows.
        copytree(self.terms.folder / "flow", self.folder / "flow", dirs_exist_ok=True)
        body = train_body(capture, self.folder, job)
        if not (self.folder / UNTUNED).is_file():
            return {"seed": self.seed} | self._scores(body, capture)
        before = self._scores(TrainedBody.load(self.folder, UNTUNED), capture)
        return {"seed": self.seed} | before | {"tuned": self._scores(body, capture)}

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


def record_standard(subject: Path, folder: Path, workers: int, garment: str = "none") -> Path:
    """Records the clip that figures are quoted for, or goes on with that.

    20 cameras, 41 frames at 15 per second, 288 pixels high: calm, gestures, and fast gestures; with
    a garment, the hips turn, too.

    Args:
        subject: The person, an `.npz` file.
        folder: Where the capture shall lie.
        workers: Threads that draw.
        garment: What the person wears over the clothes, or none.

    Returns:
        The capture's path.
    """
    if not (folder / "capture.json").is_file():
        recording = Recording(
            subject=str(subject),
            rig="body",
            cameras=20,
            frames=41,
            fps=15.0,
            views_per_frame=20,
            size=288,
            text="",
            seed=0,
            lively=True,
            light="studio",
            motion="showcase" if garment == "none" else "sway",
            garment=garment,
        )
        record(recording, folder, workers)
    return folder


def open_clip(path: Path, frames: int | None) -> Capture:
    """A capture, or its first frames only."""
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
) -> Terms:
    """Cuts the clip into windows, once for all trials.

    Raises:
        SettingsError: If unseen frames are asked for and there are none.
    """
    if unseen and (frames is None or frames >= open_capture(capture).num_frames):
        raise SettingsError(f"--unseen needs --frames N, fewer than {capture} has.")
    clip = open_clip(capture, frames)
    named = folder / (f"{clip.num_frames}-frames")
    job = BodyJob(OURS, 0, settings, device=device)
    windows = plan_windows(clip, job, named).windows
    return Terms(capture, frames, named, windows, settings, finetune, device, unseen)


def run_trials(
    trials: Sequence[Trial], jobs: int, done: Callable[[Trial, dict], None]
) -> dict[Method, list[dict]]:
    """Runs trials, in so many processes.

    Args:
        trials: The trainings to run.
        jobs: Processes; with several, each writes what it says to `log.txt` in its folder.
        done: Called with every result when it comes.

    Returns:
        Results by method, by seed ascending.
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
    """Several processes that share the cores; one that fails stops what has not begun."""
    threads = max(1, (os.cpu_count() or 1) // jobs)
    with ProcessPoolExecutor(jobs, fork_server(__name__), _share, (threads,)) as pool:
        futures = {pool.submit(_logged, trial): trial for trial in trials}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _share(threads: int) -> None:
    """Makes a process use so many threads only."""
    import numba
    import torch

    torch.set_num_threads(threads)
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))  # type: ignore (set at run time)


def _logged(trial: Trial) -> dict:
    trial.folder.mkdir(parents=True, exist_ok=True)
    with (trial.folder / "log.txt").open("a") as log, redirect_stdout(log), redirect_stderr(log):
        return trial.run()


def summary(found: dict[Method, list[dict]]) -> dict:
    """Figures of a bench.

    Args:
        found: What `run_trials` gave.

    Returns:
        By method: `seeds` (the results) and `mean` (over seeds; of lists, value by value).
        `margins`: how far SWinGS++ is above each other method, likewise. `finetune`: means of
        `before` and `after`, where it was fine-tuned. What was not measured is None.
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
    """Means of the metrics of results, of lists value by value; None counts for nothing."""
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
    """The difference of two numbers or lists of them."""
    if isinstance(ours, list):
        return [_above(a, b) for a, b in zip(ours, theirs, strict=True)]
    return None if ours is None or theirs is None else ours - theirs
