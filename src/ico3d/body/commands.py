"""The verb `ico3d train body`."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from ico3d.body.settings import PRESETS, BodySettings, Method, settings_for
from ico3d.common.device import DeviceName
from ico3d.common.presets import PresetName, chosen
from ico3d.errors import SettingsError

if TYPE_CHECKING:
    from ico3d.body.training.train_clip import Runner


@dataclass(frozen=True, kw_only=True)
class BodyChoice:
    """Options that decide the defaults of all other options.

    Attributes:
        preset: The paper's settings, or settings sized for two CPU cores. The defaults shown here
            are those of the chosen preset.
        method: SWinGS++, or a method that it is compared with: a positional encoding instead of its
            encoder (swings), one window without tuning (4dgs), Gaussians that appear, move and
            vanish by formulas (spacetime, freetime), Gaussians that do not move within a window
            (static), Gaussians on the skeleton of ico3d capture pose, with residual shapes and
            light (skinned) or without (hugs).
    """

    preset: PresetName = "cpu"
    method: Method = "swings++"


@dataclass(frozen=True)
class TrainBody(BodyChoice):
    """Trains SWinGS++, or another method, on a capture of a whole person in motion.

    The same command continues an interrupted run.

    Attributes:
        capture: A capture by calibrated, synchronised cameras, with masks.
        out: The model folder to write.
        seed: Seed of all randomness.
        hold_out: Leave out the validation cameras, too, for ico3d evaluate --frames validation.
        device: Where to compute: by default with CUDA where that works, else on the CPU; each
            machine of a Ray cluster decides for itself.
        jobs: Number of windows that train at once, each in a process of its own; with CUDA, at most
            the number of GPUs.
        ray: Address of a Ray cluster that trains the windows: host:port, or auto. The capture and
            the model folder must have the same path on all its machines.
        plan: Only measure motion and show the windows; not for methods of one window.
        dry_run: Only say how much time, memory and disk the training takes in one process; windows
            are planned, and a few steps of the longest are done.
        settings: How the body is trained.
    """

    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    seed: int = 0
    hold_out: bool = False
    device: DeviceName = "auto"
    jobs: int = 1
    ray: str | None = None
    plan: bool = False
    dry_run: bool = False
    settings: Annotated[BodySettings, tyro.conf.arg(name="")] = PRESETS["cpu"]

    @classmethod
    def defaults(cls, words: Sequence[str]) -> "TrainBody":
        """The verb with the defaults that follow from --preset and --method in `words`."""
        choice = chosen(BodyChoice, words)
        settings = settings_for(choice.preset, choice.method)
        return cls(tyro.MISSING, tyro.MISSING, settings=settings)

    def run(self) -> None:
        """Trains the body, or continues an interrupted run, and writes the model folder.

        Raises:
            Ico3dError: If the capture lacks something, or the options make no sense.
        """
        from rich.console import Console

        from ico3d.body.training.needs import needs_of_body
        from ico3d.body.training.train_clip import BodyJob, plan_windows, train_body
        from ico3d.capture.formats import open_capture
        from ico3d.splat.device import decided

        device = self.device if self.ray else decided(self.device)
        runner = None if self.plan or self.dry_run else runner_of(self.jobs, self.ray, device)
        given = (self.method, self.seed, self.settings)
        job = BodyJob(*given, device=device, hold_out=self.hold_out)
        capture = open_capture(self.capture)
        if self.plan:
            plan_windows(capture, job, self.out)
            return
        if self.dry_run:
            print(*needs_of_body(capture, self.out, job).lines(self.out), sep="\n")
            return
        body = train_body(capture, self.out, job, runner)
        seconds, count = body.summary["train_seconds"], sum(map(len, body.models))
        Console().print(
            f"{self.out}: {len(body.windows)} windows, {count} Gaussians, "
            f"trained in {seconds:.0f} s."
        )


def runner_of(jobs: int, ray: str | None, device: str) -> "Runner | None":
    """A function that trains windows in parallel; None to train them one by one in this process.

    Args:
        jobs: Number of processes on this machine.
        ray: Address of a Ray cluster; None for none.
        device: Where to compute: `cpu`, `cuda`, or `auto` for a cluster.

    Raises:
        MissingExtraError: If Ray is wanted and not installed.
        SettingsError: If `jobs` is below 1, is combined with `ray`, or exceeds the number of GPUs,
            or if no cluster answers.
    """
    from ico3d.body.workers.cluster import RayCluster
    from ico3d.body.workers.jobs import train_windows
    from ico3d.body.workers.processes import Processes

    if jobs < 1 or (jobs > 1 and ray):
        raise SettingsError(
            f"--jobs {jobs} is impossible here: it counts processes of this machine, one "
            "or more, and a Ray cluster decides by itself how many windows train at once."
        )
    if ray:
        return partial(train_windows, crew=RayCluster(ray, device != "cpu"))
    return partial(train_windows, crew=Processes(jobs, device != "cpu")) if jobs > 1 else None
