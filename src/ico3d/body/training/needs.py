"""What the training of a body takes, said before it begins."""

from pathlib import Path

from ico3d.body.training.train_clip import BodyJob, window_tasks, window_trainer
from ico3d.capture.capture import Capture
from ico3d.capture.parts.held_out import training_part
from ico3d.training.dry_run import Needs, needs_of


def needs_of_body(capture: Capture, folder: Path, job: BodyJob) -> Needs:
    """What the training of a body takes; some steps of its longest window are done.

    Args:
        capture: As for `train_body`.
        folder: As for `train_body`; only the plan of the windows and the motion that it is made of
            are written there, which the training takes over.
        job: How the body is to be trained.

    Raises:
        Ico3dError: As for `train_body`.
    """
    tasks, _ = window_tasks(capture, folder, job)
    longest = max(tasks, key=lambda task: len(task.window))
    trainer, _ = window_trainer(longest, training_part(capture, job.hold_out))
    tuned = job.settings.finetune.steps * (len(tasks) - 1)
    total = sum(task.steps for task in tasks) + tuned
    most = job.settings.density.max_gaussians
    return needs_of(trainer, longest.steps, most, total, len(tasks), trainer.pictures_needed())
