"""Trains the head, and shows it while it learns."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ico3d.avatar.forgetting.removal import remove
from ico3d.capture.capture import Capture
from ico3d.creating.events import Advanced, Preview, Tell
from ico3d.creating.settings import CreateSettings, Quality
from ico3d.head.model_folder import TrainedHead
from ico3d.head.optimise import HeadTrainer
from ico3d.head.train_head import HeadJob, train_head
from ico3d.head.watch import WatchedHead
from ico3d.training.loop import Watch
from ico3d.training.run import goes_on

TOLD, SHOWN = 100, 12
"""Number of times that progress is told, and that the face is shown."""


def learn(
    capture: Capture, folder: Path, settings: CreateSettings, quality: Quality, tell: Tell
) -> TrainedHead:
    """Trains the head, or goes on with it; at once if it is trained.

    What was learnt in another way, as by an earlier version of ico3d, is learnt anew.

    Raises:
        CaptureError: If the capture lacks something that the training needs.
        ModelError: If training diverges.
        SettingsError: If something in the folder cannot be removed.
        StorageError: If the disk is full.
    """
    job = HeadJob("speech", "full", "builtin", 0, quality.head)
    if not goes_on(folder, job.about(capture.path)):
        remove([folder])
    watched = partial(_shown, steps=quality.head.steps, tell=tell)
    return train_head(capture, folder, job, watched, settings.device)


@contextmanager
def _shown(trainer: HeadTrainer, steps: int, tell: Tell) -> Iterator[Watch]:
    yield _Observer(WatchedHead(trainer), steps, tell)


class _Observer:
    """Tells how far the training is, and shows a frame as recorded and as learnt so far."""

    def __init__(self, head: WatchedHead, steps: int, tell: Tell):
        self._head, self._steps, self._tell = head, steps, tell

    def after_step(self, done: int, values: Mapping[str, float | Tensor]) -> None:
        """Tells and shows what is due after so many steps."""
        del values
        if self._is_due(done, TOLD):
            self._tell(Advanced("learn", done / self._steps, "learning the face"))
        if self._is_due(done, SHOWN):
            pair = torch.cat(self._head.pictures(self._head.frames // 2), 1)  # (H, 2·W, 3)
            picture = (pair.clamp(0, 1) * 255 + 0.5).to(torch.uint8).numpy()
            self._tell(Preview(done / self._steps, np.ascontiguousarray(picture)))

    def _is_due(self, done: int, times: int) -> bool:
        """Whether a thing that is done so many times in all is due after this step."""
        return done * times // self._steps > (done - 1) * times // self._steps
