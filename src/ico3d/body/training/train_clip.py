"""From a capture to a model folder: plans windows, trains them, fine-tunes, saves."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch
from rich.console import Console

from ico3d.body.companion import Companion, CompanionSource
from ico3d.body.model_folder import ABOUT, UNTUNED, TrainedBody, load_window, save_window
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.planning.flow import clip_flow, dynamic_weights
from ico3d.body.planning.plan import Plan, is_saved, make_plan, print_plan, save_plan
from ico3d.body.planning.plan_picture import draw_plan
from ico3d.body.planning.windows import Window
from ico3d.body.settings import ONE_WINDOW, SKINNED, BodySettings, Method
from ico3d.body.training.finetune_window import FineTuner
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.body.training.prepare_skinned import tracked
from ico3d.body.training.prepare_window import Begin, begin_window, continued_window
from ico3d.body.training.views import BodyViews
from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.pictures import train_cameras
from ico3d.common.device import DeviceName
from ico3d.errors import ModelError
from ico3d.splat.device import computing_device
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.run import RunFolder

WINDOW_FILE = "window.safetensors"


@dataclass(frozen=True)
class BodyJob:
    """What to train.

    Attributes:
        method: SWinGS++ or what it is compared with.
        seed: All randomness follows from it.
        settings: How to train.
        companion: Where the Gaussians come from that the body is trained with, if any.
        continued: Folder of a body with the same windows to go on from, instead of from points.
        device: Where to compute; decided by each process that trains. A run may go on elsewhere.
    """

    method: Method
    seed: int
    settings: BodySettings
    companion: CompanionSource | None = None
    continued: Path | None = None
    device: DeviceName = "auto"

    def about(self, capture: Path) -> dict:
        """What a run of this job on a capture is known by, but for its settings."""
        about = {"capture": str(capture.resolve()), "method": self.method, "seed": self.seed}
        if self.continued is not None:
            about["continued"] = str(self.continued.resolve())
        return about | ({"companion": self.companion.about()} if self.companion else {})


@dataclass(frozen=True)
class WindowTask:
    """One window's training, which depends on no other.

    Attributes:
        capture: Path of the capture.
        folder: Where the window's run lies.
        flow: Folder of the optical flow, shared by all windows.
        window: The window's frames.
        index: Its number.
        job: Method, seed, settings and what to go on from.
    """

    capture: Path
    folder: Path
    flow: Path
    window: Window
    index: int
    job: BodyJob

    @property
    def file(self) -> Path:
        """The trained window."""
        return self.folder / WINDOW_FILE

    @property
    def steps(self) -> int:
        """Optimisation steps."""
        return self.job.settings.steps_of(len(self.window))

    @property
    def label(self) -> str:
        """The window's name in progress bars and errors."""
        return f"window {self.index} (frames {self.window.first} to {self.window.last})"


Runner = Callable[[Sequence[WindowTask]], Sequence[float]]
"""Trains windows; gives the seconds spent in steps by window."""


def train_window(task: WindowTask, capture: Capture | None = None) -> float:
    """Trains a window, or goes on with an interrupted run of the same settings.

    Args:
        task: The window and how it is trained.
        capture: The opened capture, where the caller has it open already.

    Returns:
        Seconds spent in steps.

    Raises:
        CaptureError: If the capture lacks something that is needed.
        SettingsError: If the folder holds a run with other settings, or CUDA does not work.
        ModelError: If training diverges.
    """
    job, window = task.job, task.window
    run = RunFolder(task.folder, _about(task.capture, window, job))
    finished = run.finished()
    if finished is not None:
        return finished["train_seconds"]
    capture = capture or open_capture(task.capture)
    device = computing_device(job.device)
    companion = job.companion.open(device) if job.companion else None
    begin = _begin(task, capture, companion, device)
    begin.model.to(device)
    pictures = BodyViews(capture, window.frames, job.settings.cache_gib)
    seed = job.seed + 1_000 * task.index
    trainer = BodyTrainer(
        begin.model, window, pictures, job.method, job.settings, begin.extent, seed, companion
    )
    loop = LoopSettings(
        task.steps,
        checkpoint_every=job.settings.checkpoint_every,
        label=task.label,
    )
    seconds = run_loop(trainer, run, loop)
    save_window(task.file, trainer.model)
    summary = {"train_seconds": seconds, "num_gaussians": len(trainer.model)}
    run.finish({**summary, "extent": begin.extent, "source": begin.source})
    return seconds


def _begin(
    task: WindowTask, capture: Capture, companion: Companion | None, device: torch.device
) -> Begin:
    """What a window's training begins with."""
    job, window = task.job, task.window
    if job.continued is not None:
        body = TrainedBody.load(job.continued)
        return continued_window(body.models[task.index], window, companion)

    def dynamic(points):
        flow = clip_flow(capture, task.flow, device=device)
        return dynamic_weights(points, capture, window, flow)

    return begin_window(capture, window, job.method, job.settings, dynamic, job.seed, companion)


def finetune_window(
    task: WindowTask, capture: Capture, trained: Path, previous: WindowModel
) -> float:
    """Fine-tunes a window to agree with the one before, or goes on with an interrupted run.

    Args:
        task: Which; its folder is where the fine-tuning's run lies.
        capture: The opened capture.
        trained: Folder of the window's training.
        previous: The window before, fine-tuned itself.

    Returns:
        Seconds spent in steps.
    """
    job, window = task.job, task.window
    about = _about(task.capture, window, job)
    run = RunFolder(task.folder, about | {"settings": asdict(job.settings)})
    finished = run.finished()
    if finished is not None:
        return finished["train_seconds"]
    model = load_window(trained / WINDOW_FILE)
    before = RunFolder(trained, about).finished()
    assert before is not None
    device = computing_device(job.device)
    model.to(device)
    previous.to(device)
    cameras = [capture.cameras[index] for index in train_cameras(capture)]
    pictures = BodyViews(capture, window.frames, job.settings.cache_gib)
    seed = job.seed + 1_000 * task.index + 500
    companion = job.companion.open(device) if job.companion else None
    tuner = FineTuner(
        model, previous, window, pictures, cameras, job.settings, before["extent"], seed, companion
    )
    loop = LoopSettings(
        job.settings.finetune.steps,
        checkpoint_every=job.settings.checkpoint_every,
        label=f"fine-tuning window {task.index}",
    )
    seconds = run_loop(tuner, run, loop)
    save_window(task.file, tuner.model)
    run.finish({"train_seconds": seconds, "num_gaussians": len(tuner.model)})
    return seconds


def train_body(
    capture: Capture, folder: Path, job: BodyJob, runner: Runner | None = None
) -> TrainedBody:
    """Trains a body, or goes on with an interrupted run of the same settings.

    Args:
        capture: Calibrated, synchronised cameras with masks.
        folder: Model folder; also holds the plan, and the run of every window.
        job: Method, seed, settings and what to go on from.
        runner: Trains the windows; one after another in this process by default.

    Returns:
        The trained body, as the folder now holds it.

    Raises:
        CaptureError: If the capture lacks something that is needed.
        SettingsError: If the folder holds a run with other settings.
        ModelError: If training diverges.
    """
    if job.method in SKINNED:
        tracked(capture)  # before a folder is made, and the clip is cut into windows
    run = RunFolder(folder, job.about(capture.path) | {"settings": asdict(job.settings)})
    if run.finished() is not None:
        return TrainedBody.load(folder)
    if job.continued is not None:
        windows = _fitting(TrainedBody.load(job.continued), capture, job).windows
    else:
        windows = plan_windows(capture, job, folder).windows
    tasks = [
        WindowTask(
            capture.path, folder / "windows" / f"{index:04d}", folder / "flow", window, index, job
        )
        for index, window in enumerate(windows)
    ]
    seconds = sum(runner(tasks) if runner else (train_window(task, capture) for task in tasks))
    body = _save(capture, folder, job, tasks, seconds)
    if job.settings.finetune.steps and len(tasks) > 1:
        _save(capture, folder, job, tasks, seconds, UNTUNED)
        tuned = [replace(t, folder=folder / "finetuned" / f"{t.index:04d}") for t in tasks[1:]]
        for before, task, after in zip(tasks, tasks[1:], tuned, strict=False):
            source = before if before.index == 0 else tuned[before.index - 1]
            seconds += finetune_window(after, capture, task.folder, load_window(source.file))
        body = _save(capture, folder, job, [tasks[0], *tuned], seconds)
    run.finish({"train_seconds": seconds, "num_gaussians": sum(map(len, body.models))})
    return body


def _fitting(body: TrainedBody, capture: Capture, job: BodyJob) -> TrainedBody:
    """A body that a job goes on from.

    Raises:
        ModelError: If it is of another method or another clip.
    """
    if body.method != job.method:
        raise ModelError(
            f"{job.continued} was trained with --method {body.method}: only a body of the method "
            f"{job.method} can be gone on from."
        )
    frames = body.windows[-1].last + 1
    if (frames, body.fps) != (capture.num_frames, capture.fps):
        raise ModelError(
            f"{job.continued} has {frames} frames at {body.fps:g} per second, {capture.path} has "
            f"{capture.num_frames} at {capture.fps:g}: go on from a body of this capture."
        )
    return body


def plan_windows(capture: Capture, job: BodyJob, folder: Path) -> Plan:
    """The windows of a clip, shown and drawn; methods of one window take all of it."""
    plan = make_plan(capture, job.settings.windows, folder, computing_device(job.device))
    if job.method in ONE_WINDOW:
        plan = replace(plan, windows=(Window(0, capture.num_frames - 1),))
    print_plan(plan, Console())
    told, picture = folder / "plan.json", folder / "plan.png"
    if not (picture.is_file() and is_saved(plan, told)):  # a run that goes on has both
        draw_plan(plan, capture, picture)
        save_plan(plan, told)
    return plan


def _save(
    capture: Capture,
    folder: Path,
    job: BodyJob,
    tasks: Sequence[WindowTask],
    seconds: float,
    about: str = ABOUT,
) -> TrainedBody:
    """Names the windows' files in the model folder."""
    summary = {
        "train_seconds": seconds,
        "capture": capture.provenance,
        "settings": asdict(job.settings),
    }
    models = [load_window(task.file) for task in tasks]
    windows = tuple(task.window for task in tasks)
    body = TrainedBody(models, windows, capture.fps, job.method, summary)
    body.save(folder, [str(task.file.relative_to(folder)) for task in tasks], about)
    return body


def _about(capture: Path, window: Window, job: BodyJob) -> dict:
    """What a window's run is known by: fine-tuning can be done anew without training anew."""
    settings = asdict(job.settings)
    del settings["finetune"]
    return job.about(capture) | asdict(window) | {"settings": settings}
