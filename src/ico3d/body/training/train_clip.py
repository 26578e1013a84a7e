"""Trains a body from a capture: plans windows, trains them, fine-tunes, saves a model folder."""

import os
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
from ico3d.body.planning.windows import Window, segments
from ico3d.body.settings import ONE_WINDOW, SKINNED, BodySettings, Method
from ico3d.body.training.finetune_window import FineTuner
from ico3d.body.training.optimise_window import BodyTrainer
from ico3d.body.training.prepare_skinned import tracked
from ico3d.body.training.prepare_window import Begin, begin_window, continued_window
from ico3d.body.training.views import BodyViews
from ico3d.capture.capture import Capture
from ico3d.capture.formats import open_capture
from ico3d.capture.parts.held_out import training_part
from ico3d.capture.parts.trained_on import trained_on
from ico3d.capture.pictures import train_cameras
from ico3d.common.device import DeviceName
from ico3d.common.files import resolved
from ico3d.errors import ModelError, SettingsError
from ico3d.splat.device import computing_device
from ico3d.training.loop import LoopSettings, run_loop
from ico3d.training.notes.lock import lets_go
from ico3d.training.provenance import note_environment, provenance
from ico3d.training.run import RunFolder

WINDOW_FILE = "window.safetensors"


@dataclass(frozen=True)
class BodyJob:
    """How a body is to be trained.

    Attributes:
        method: How Gaussians are moved.
        seed: Seed of all randomness.
        settings: Settings of the training.
        companion: Source of other Gaussians that are in the pictures; None for none.
        continued: Folder of a trained body on the same clip, whose windows training goes on from;
            None begins with points on the surface.
        device: Where to compute, decided by each process that trains. An interrupted run may go on
            with another device.
        hold_out: Whether the validation cameras are left out of the training.
    """

    method: Method
    seed: int
    settings: BodySettings
    companion: CompanionSource | None = None
    continued: Path | None = None
    device: DeviceName = "auto"
    hold_out: bool = False

    def about(self, capture: Path) -> dict:
        """Values, beside the settings, that a run must share with an interrupted one."""
        about = {"capture": str(resolved(capture)), "method": self.method, "seed": self.seed}
        if self.continued is not None:
            about["continued"] = str(resolved(self.continued))
        if self.hold_out:
            about["hold_out"] = True
        return about | ({"companion": self.companion.about()} if self.companion else {})


@dataclass(frozen=True)
class WindowTask:
    """The training of one window, which is independent of other windows.

    Attributes:
        capture: Path of the capture.
        folder: Run folder of the window.
        flow: Folder with cached optical flow, shared by all windows.
        window: Frames of the window.
        index: Index of the window.
        job: How the body is to be trained.
    """

    capture: Path
    folder: Path
    flow: Path
    window: Window
    index: int
    job: BodyJob

    @property
    def file(self) -> Path:
        """File of the trained window."""
        return self.folder / WINDOW_FILE

    @property
    def steps(self) -> int:
        """Number of optimisation steps."""
        return self.job.settings.steps_of(len(self.window))

    @property
    def label(self) -> str:
        """The window's name in progress bars and errors."""
        return f"window {self.index} (frames {self.window.first} to {self.window.last})"


Runner = Callable[[Sequence[WindowTask]], Sequence[float]]
"""Trains windows; returns the seconds spent in optimisation steps for each of them."""


@lets_go
def train_window(task: WindowTask, capture: Capture | None = None) -> float:
    """Trains a window and writes its file, or continues an interrupted run of the same settings.

    Args:
        task: The window and how it is trained.
        capture: The opened capture; None opens it here.

    Returns:
        Seconds spent in optimisation steps.

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
    capture = training_part(capture or open_capture(task.capture), job.hold_out)
    trainer, begin = window_trainer(task, capture)
    note_environment(task.folder, trainer.model.device)
    every = job.settings.checkpoint_every
    loop = LoopSettings(task.steps, checkpoint_every=every, label=task.label)
    seconds = run_loop(trainer, run, loop)
    save_window(task.file, trainer.model)
    summary = {"train_seconds": seconds, "num_gaussians": len(trainer.model)}
    run.finish({**summary, "extent": begin.extent, "source": begin.source})
    return seconds


def window_trainer(task: WindowTask, capture: Capture) -> tuple[BodyTrainer, Begin]:
    """The trainee of a window before its first step, and the state in which it begins."""
    job, window = task.job, task.window
    device = computing_device(job.device)
    companion = job.companion.open(device) if job.companion else None
    begin = _begin(task, capture, companion, device)
    begin.model.to(device)
    pictures = BodyViews(capture, window.frames, job.settings.cache_gib, job.settings.cache_dir)
    seed = job.seed + 1_000 * task.index
    trainer = BodyTrainer(
        begin.model, window, pictures, job.method, job.settings, begin.extent, seed, companion
    )
    return trainer, begin


def _begin(
    task: WindowTask, capture: Capture, companion: Companion | None, device: torch.device
) -> Begin:
    """The state in which a window's training begins."""
    job, window = task.job, task.window
    if job.continued is not None:
        body = TrainedBody.load(job.continued)
        return continued_window(body.models[task.index], window, companion)

    def dynamic(points):
        flow = clip_flow(capture, task.flow, device=device)
        return dynamic_weights(points, capture, window, flow)

    return begin_window(capture, window, job.method, job.settings, dynamic, job.seed, companion)


@lets_go
def finetune_window(
    task: WindowTask, capture: Capture, trained: Path, previous: WindowModel
) -> float:
    """Fine-tunes a window to agree with the window before, or continues an interrupted run.

    Args:
        task: The window; its folder is the run folder of the fine-tuning.
        capture: The opened capture.
        trained: Run folder of the window's training.
        previous: Model of the window before, after its own fine-tuning.

    Returns:
        Seconds spent in optimisation steps.

    Raises:
        SettingsError: If the folder holds a run with other settings, or CUDA does not work.
        ModelError: If training diverges.
    """
    job, window = task.job, task.window
    about = _about(task.capture, window, job)
    run = RunFolder(task.folder, about | {"settings": asdict(job.settings)})
    finished = run.finished()
    if finished is not None:
        return finished["train_seconds"]
    capture = training_part(capture, job.hold_out)
    model = load_window(trained / WINDOW_FILE)
    before = RunFolder(trained, about).finished()
    assert before is not None
    device = computing_device(job.device)
    note_environment(task.folder, device)
    model.to(device)
    previous.to(device)
    cameras = [capture.cameras[index] for index in train_cameras(capture)]
    pictures = BodyViews(capture, window.frames, job.settings.cache_gib, job.settings.cache_dir)
    seed = job.seed + 1_000 * task.index + 500
    companion = job.companion.open(device) if job.companion else None
    tuner = FineTuner(
        model, previous, window, pictures, cameras, job.settings, before["extent"], seed, companion
    )
    steps, every = job.settings.finetune.steps, job.settings.checkpoint_every
    loop = LoopSettings(steps, checkpoint_every=every, label=f"fine-tuning window {task.index}")
    seconds = run_loop(tuner, run, loop)
    save_window(task.file, tuner.model)
    run.finish({"train_seconds": seconds, "num_gaussians": len(tuner.model)})
    return seconds


@lets_go
def train_body(
    capture: Capture, folder: Path, job: BodyJob, runner: Runner | None = None
) -> TrainedBody:
    """Trains a body, or continues an interrupted run of the same settings.

    Args:
        capture: Recording by calibrated, synchronised cameras, with masks.
        folder: Model folder, which also holds the run of each window and, unless the method takes
            the clip as one window, the plan.
        job: How the body is to be trained.
        runner: Trains the windows; by default one after another in this process.

    Returns:
        The trained body, as the folder now holds it.

    Raises:
        CaptureError: If the capture lacks something that is needed.
        SettingsError: If the folder holds a run with other settings.
        ModelError: If training diverges, or `job.continued` is of another method or clip.
    """
    if job.method in SKINNED:
        tracked(capture)  # raises before a folder is made
        if job.settings.sh_degree or job.settings.windows.segment:
            raise SettingsError(
                f"--sh-degree and --windows.segment are not for --method {job.method}: on a "
                "skeleton colours follow the light, and the clip is one window."
            )
    run = RunFolder(folder, job.about(capture.path) | {"settings": asdict(job.settings)})
    if run.finished() is not None:
        return TrainedBody.load(folder)
    tasks, flow = window_tasks(capture, folder, job)
    run.expect(sum(task.steps for task in tasks) + job.settings.finetune.steps * (len(tasks) - 1))
    seconds = sum(runner(tasks) if runner else (train_window(task, capture) for task in tasks))
    made = _made(job, tasks, flow)
    body = _save(capture, folder, job, tasks, seconds, made)
    if job.settings.finetune.steps and len(tasks) > 1:
        _save(capture, folder, job, tasks, seconds, made, UNTUNED)
        tuned = [replace(t, folder=folder / "finetuned" / f"{t.index:04d}") for t in tasks[1:]]
        for before, task, after in zip(tasks, tasks[1:], tuned, strict=False):
            source = before if before.index == 0 else tuned[before.index - 1]
            seconds += finetune_window(after, capture, task.folder, load_window(source.file))
        made = _made(job, [*tasks, *tuned], flow)
        body = _save(capture, folder, job, [tasks[0], *tuned], seconds, made)
    run.finish({"train_seconds": seconds, "num_gaussians": sum(map(len, body.models))})
    return body


def window_tasks(
    capture: Capture, folder: Path, job: BodyJob
) -> tuple[list[WindowTask], str | None]:
    """The trainings of the windows, and how motion was measured to plan them, where it was.

    Raises:
        ModelError: If `job.continued` is of another method or clip.
    """
    flow = None
    if job.continued is not None:
        windows = _fitting(TrainedBody.load(job.continued), capture, job).windows
    elif job.method in ONE_WINDOW:
        windows = segments(capture.num_frames, job.settings.windows.segment)
    else:
        plan = plan_windows(capture, job, folder)
        windows, flow = plan.windows, plan.method
    runs, flows = folder / "windows", folder / "flow"
    tasks = [
        WindowTask(capture.path, runs / f"{index:04d}", flows, window, index, job)
        for index, window in enumerate(windows)
    ]
    return tasks, flow


def _fitting(body: TrainedBody, capture: Capture, job: BodyJob) -> TrainedBody:
    """Checks that training can go on from a body; returns this body.

    Raises:
        ModelError: If the body is of another method or another clip.
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
    """Plans the windows of a clip, prints them, and writes plan.json and plan.png.

    Args:
        capture: The recording.
        job: Method and settings.
        folder: The model folder.

    Raises:
        CaptureError: If motion cannot be measured.
        MissingExtraError: If no flow method is installed.
        SettingsError: If the settings of windows contradict one another, or the method takes the
            clip as one window.
    """
    if job.method in ONE_WINDOW:
        raise SettingsError(
            f"--method {job.method} takes the clip as one window, so there is nothing to plan."
        )
    capture = training_part(capture, job.hold_out)
    plan = make_plan(capture, job.settings.windows, folder, computing_device(job.device))
    print_plan(plan, Console())
    told, picture = folder / "plan.json", folder / "plan.png"
    if not (os.path.isfile(picture) and is_saved(plan, told)):  # a continued run has both already
        draw_plan(plan, capture, picture)
        save_plan(plan, told)
    return plan


def _save(
    capture: Capture,
    folder: Path,
    job: BodyJob,
    tasks: Sequence[WindowTask],
    seconds: float,
    made: dict,
    about: str = ABOUT,
) -> TrainedBody:
    """Writes the file `about`, which lists the windows' files; returns the body."""
    known = capture.provenance
    summary: dict[str, object] = {
        "train_seconds": seconds,
        "capture": tracked(capture).credited(known) if job.method in SKINNED else known,
        "recording": _record(capture, job),
        "settings": asdict(job.settings),
        "made": made,
    }
    if job.continued is not None:
        summary["continued"] = TrainedBody.load(job.continued).records
    models = [load_window(task.file) for task in tasks]
    windows = tuple(task.window for task in tasks)
    body = TrainedBody(models, windows, capture.fps, job.method, summary)
    body.save(folder, [str(task.file.relative_to(folder)) for task in tasks], about)
    return body


def _record(capture: Capture, job: BodyJob) -> dict:
    """Which pictures train the body."""
    part = training_part(capture, job.hold_out)
    return trained_on(capture, train_cameras(part), part.split.train)


def _made(job: BodyJob, tasks: Sequence[WindowTask], flow: str | None) -> dict:
    """How a body was made by some runs; `flow` names the flow method, None where none was used."""
    settings = job.settings
    raised = min((task.steps - 1) // settings.sh_every for task in tasks)
    used = {
        "optimiser": "adam",
        "flow": flow,
        "sh_degree": min(raised, settings.sh_degree),
        "color_correction": settings.color_correction,
    }
    return provenance([task.folder for task in tasks], job.seed, used)


def _about(capture: Path, window: Window, job: BodyJob) -> dict:
    """Values that a window's run must share with an interrupted one.

    Settings of fine-tuning are not among them: it can be repeated without training again.
    """
    settings = asdict(job.settings)
    settings.pop("finetune")
    return job.about(capture) | asdict(window) | {"settings": settings}
