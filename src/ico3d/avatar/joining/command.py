"""The verb `ico3d assemble`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ico3d.common.device import DeviceName

if TYPE_CHECKING:
    from ico3d.avatar.joining.assemble import Assembly


@dataclass(frozen=True)
class Assemble:
    """Puts a trained head on a person's body, and trains the body around it.

    Aligns the head with every frame, matches its colours to the light in which the body was
    recorded, trains the body's windows with the head in the picture, and measures the seam. The
    same command goes on where it was interrupted.

    Attributes:
        head: A model folder of ico3d train head.
        capture: A capture of the same person's whole body, with head poses and masks.
        out: The avatar's folder to write.
        body: A folder of ico3d train body on that capture, to go on from: a third of the steps.
        preset: Settings of the body: the paper's, or sized for two CPU cores.
        set: Changes, as name=value (names: ico3d.avatar.joining.assemble.JoiningSettings and
            ico3d.body.settings.BodySettings).
        check: Write pictures here that show the head drawn over the body's recordings.
        seed: All randomness follows from it.
        device: Where to compute: by default with CUDA where that works, else on the CPU; machines
            of a Ray cluster decide for themselves.
        jobs: Windows that train at once, each in a process of its own.
        ray: Address of a Ray cluster that trains the windows, host:port or auto.
    """

    head: tyro.conf.Positional[Path]
    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    body: Path | None = None
    preset: Literal["cpu", "paper"] = "cpu"
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    check: Path | None = None
    seed: int = 0
    device: DeviceName = "auto"
    jobs: int = 1
    ray: str | None = None

    def run(self) -> None:
        """Assembles, or goes on with that.

        Raises:
            Ico3dError: If head and capture lack something or do not fit.
        """
        import torch
        from rich.console import Console

        from ico3d.avatar.joining import assemble
        from ico3d.avatar.joining.checking import write_checks
        from ico3d.body.commands import runner_of
        from ico3d.capture.formats import open_capture
        from ico3d.splat.device import decided

        console, capture = Console(), open_capture(self.capture)
        device = decided(self.device)
        runner = runner_of(self.jobs, self.ray, self.device if self.ray else device)
        assembly = self._assembly()
        assemble.prepare(capture, self.out, assembly, console.print)
        if self.check:
            write_checks(self.out, capture, self.check, torch.device(device))
            console.print(f"{self.check}: the head over {capture.path}.")
        avatar = assemble.assemble(capture, self.out, assembly, console.print, runner)
        console.print(
            f"{self.out}: a head of {len(avatar.head.model)} Gaussians on a body of "
            f"{len(avatar.body.windows)} windows."
        )

    def _assembly(self) -> "Assembly":
        """What was asked for.

        Raises:
            SettingsError: If a change is of nothing that there is.
        """
        from dataclasses import fields, replace

        from ico3d.avatar.joining.assemble import Assembly, JoiningSettings
        from ico3d.body.settings import settings_for
        from ico3d.training.changes import with_changes

        names = {field.name for field in fields(JoiningSettings)}
        ours = tuple(change for change in self.set if change.partition("=")[0] in names)
        theirs = tuple(change for change in self.set if change not in ours)
        body = settings_for(self.preset, "swings++")
        if self.body:
            body = replace(
                body,
                steps=body.steps // 3,
                steps_per_frame=body.steps_per_frame // 3,
                warmup_steps=0,
            )
        joining = with_changes(JoiningSettings(), ours)
        changed = with_changes(body, theirs)
        return Assembly(self.head, joining, changed, self.seed, self.body, self.device)
