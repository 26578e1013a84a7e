"""The verb `ico3d assemble`."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from ico3d.avatar.joining.settings import JoiningSettings
from ico3d.body.settings import PRESETS, BodySettings, Method, settings_for
from ico3d.common.device import DeviceName
from ico3d.common.presets import PresetName, chosen

if TYPE_CHECKING:
    from ico3d.avatar.joining.assemble import Assembly


@dataclass(frozen=True, kw_only=True)
class AssembleChoice:
    """Options that decide the defaults of all other options.

    Attributes:
        preset: The paper's settings of the body, or settings sized for two CPU cores. The defaults
            shown here are those of the chosen preset.
        method: How the body is moved. SWinGS++ repeats what was recorded; skinned binds it to the
            skeleton of ico3d capture pose, so that the person can make gestures that were not
            recorded; the others are for comparison, as in ico3d train body.
        body: A folder of ico3d train body on the same capture, from which training goes on with a
            third of the steps.
    """

    preset: PresetName = "cpu"
    method: Method = "swings++"
    body: Path | None = None


@dataclass(frozen=True)
class Assemble(AssembleChoice):
    """Puts a trained head on a person's body, and trains the body around it.

    Aligns the head with every frame, matches its colours to the light in which the body was
    recorded, trains the body's windows with the head in the picture, and measures the seam. The
    same command continues an interrupted run.

    Attributes:
        head: A model folder of ico3d train head.
        capture: A capture of the same person's whole body, with head poses and masks.
        out: The avatar's folder to write.
        check: Folder for pictures that show the head drawn over the body's recording.
        seed: Seed of all randomness.
        hold_out: Leave out the validation cameras, too, for ico3d evaluate --frames validation.
        device: Where to compute: by default with CUDA where that works, else on the CPU; each
            machine of a Ray cluster decides for itself.
        jobs: Number of windows that train at once, each in a process of its own.
        ray: Address of a Ray cluster that trains the windows: host:port, or auto.
        joining: How the head is put on the body.
        settings: How the body is trained.
    """

    head: tyro.conf.Positional[Path]
    capture: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    check: Path | None = None
    seed: int = 0
    hold_out: bool = False
    device: DeviceName = "auto"
    jobs: int = 1
    ray: str | None = None
    joining: JoiningSettings = field(default_factory=JoiningSettings)
    settings: Annotated[BodySettings, tyro.conf.arg(name="")] = PRESETS["cpu"]

    @classmethod
    def defaults(cls, words: Sequence[str]) -> "Assemble":
        """The verb with the defaults that follow from --preset, --method and --body in `words`."""
        choice = chosen(AssembleChoice, words)
        settings = settings_for(choice.preset, choice.method)
        if choice.body is not None:
            steps, per_frame = settings.steps // 3, settings.steps_per_frame // 3
            settings = replace(settings, steps=steps, steps_per_frame=per_frame, warmup_steps=0)
        return cls(tyro.MISSING, tyro.MISSING, tyro.MISSING, settings=settings)

    def run(self) -> None:
        """Assembles the avatar, or continues an interrupted run.

        Raises:
            Ico3dError: If head or capture lack something, or do not fit together.
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
        assembly = self.assembly()
        assemble.prepare(capture, self.out, assembly, console.print)
        if self.check:
            write_checks(self.out, capture, self.check, torch.device(device))
            console.print(f"{self.check}: the head over {capture.path}.")
        avatar = assemble.assemble(capture, self.out, assembly, console.print, runner)
        console.print(
            f"{self.out}: a head of {len(avatar.head.model)} Gaussians on a body of "
            f"{len(avatar.body.windows)} windows."
        )

    def assembly(self) -> "Assembly":
        """The options as an `Assembly`."""
        from ico3d.avatar.joining.assemble import Assembly

        return Assembly(
            self.head,
            self.joining,
            self.settings,
            self.seed,
            self.method,
            self.body,
            self.device,
            self.hold_out,
        )
