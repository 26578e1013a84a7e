"""The verb `ico3d train body`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


@dataclass(frozen=True)
class TrainBody:
    """Trains SWinGS++ on a capture of a whole person in motion.

    The same command goes on where it was interrupted.

    Attributes:
        capture: A capture by calibrated, synchronised cameras, with masks.
        out: The model folder to write.
        method: SWinGS++, or what it is compared with: a positional encoding in the place of its
            encoder, one window without tuning, Gaussians that come and go by formulas, Gaussians
            that do not move within a window.
        preset: Settings of the paper, or sized for two CPU cores.
        set: Changes to the preset, as name=value (names: ico3d.body.settings.BodySettings).
        seed: All randomness follows from it.
        plan: Only measures motion and shows the windows.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    method: Literal["swings++", "swings", "4dgs", "spacetime", "freetime", "static"] = "swings++"
    preset: Literal["cpu", "paper"] = "cpu"
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    seed: int = 0
    plan: bool = False

    def run(self) -> None:
        """Trains, or goes on training; writes the model folder."""
        from rich.console import Console

        from ico3d.body.settings import settings_for
        from ico3d.body.train import BodyJob, plan_windows, train_body
        from ico3d.capture.capture import Capture
        from ico3d.training.changes import with_changes

        settings = with_changes(settings_for(self.preset, self.method), self.set)
        job = BodyJob(self.method, self.seed, settings)
        capture = Capture.open(self.capture)
        if self.plan:
            plan_windows(capture, job, self.out)
            return
        body = train_body(capture, self.out, job)
        seconds, count = body.summary["train_seconds"], sum(map(len, body.models))
        Console().print(
            f"{self.out}: {len(body.windows)} windows, {count} Gaussians, "
            f"trained in {seconds:.0f} s."
        )
