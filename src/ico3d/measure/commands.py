"""The verbs `ico3d evaluate` and `ico3d bench`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from ico3d.common.device import DeviceName

if TYPE_CHECKING:
    from ico3d.avatar.avatar import TrainedAvatar
    from ico3d.body.model_folder import TrainedBody
    from ico3d.capture.capture import Capture


@dataclass(frozen=True)
class Evaluate:
    """Measures a trained head, body, whole person or static scene against a capture.

    Attributes:
        model: Model folder written by ico3d train head, train body, train static or assemble.
        capture: The recording to compare with; its sound or blendshapes drive the head.
        json: File for the metrics.
        images: Folder for pictures: {pred,gt,mask}/CAMERA/%06d.png.
        frames: `test`: the capture's test frames (of a single frame its test cameras); of a capture
            of the whole body all frames by the test cameras. `validation`: likewise those of a
            model that was trained with --hold-out. `all`: all frames by all cameras, for a capture
            that was not used for training. Refused where a test or validation picture trained
            anything in the model.
        plots: For bodies: folder for plots of PSNR over frames and by camera.
        untuned: For bodies: measure the windows as they were before temporal fine-tuning.
        openface: For heads: two tables (.csv) that OpenFace wrote of the rendered and of the
            recorded pictures (see --images), for the error of action units.
        device: Where to compute: by default CUDA where that works, else the CPU.
    """

    model: tyro.conf.Positional[Path]
    capture: tyro.conf.Positional[Path]
    json: Path | None = None
    images: Path | None = None
    frames: Literal["test", "validation", "all"] = "test"
    plots: Path | None = None
    untuned: bool = False
    openface: tuple[Path, Path] | None = None
    device: DeviceName = "auto"

    def run(self) -> None:
        """Prints the metrics and writes the files that were asked for."""
        import json

        from rich.console import Console

        from ico3d.capture.formats import open_capture
        from ico3d.common.files import write_atomic
        from ico3d.errors import printable

        metrics = self._metrics(open_capture(self.capture))
        if self.json is not None:
            write_atomic(self.json, json.dumps(metrics, indent=1).encode())
        console = Console()
        for name, value in metrics.items():
            if isinstance(value, list):
                continue  # parts of the whole: for the file
            shown = f"{value:.5g}" if isinstance(value, int | float) else printable(str(value))
            said = f"{name:16} {'not measured' if value is None else shown}"
            console.print(said, markup=False)

    def _metrics(self, capture: "Capture") -> dict:
        """Measures what the folder holds, whatever it is."""
        from ico3d.avatar.avatar import TrainedAvatar
        from ico3d.avatar.models import open_model
        from ico3d.body.model_folder import TrainedBody
        from ico3d.capture.parts.head_of_body import head_in
        from ico3d.capture.parts.held_out import PartOfCapture, scored_pictures
        from ico3d.capture.parts.trained_on import check_untrained
        from ico3d.errors import SettingsError
        from ico3d.head.model_folder import TrainedHead
        from ico3d.measure.head import evaluate_head
        from ico3d.measure.scene import evaluate_scene
        from ico3d.scene.model_folder import TrainedScene
        from ico3d.splat.device import computing_device

        model = open_model(self.model, TrainedHead, TrainedBody, TrainedAvatar, TrainedScene)
        model.to(computing_device(self.device))
        if isinstance(model, TrainedScene):
            if self.frames == "validation":
                raise SettingsError("a static scene has no validation pictures: use --frames test.")
            return evaluate_scene(model, capture, self.frames, self.images)
        cameras, frames = scored_pictures(capture, self.frames)
        if self.frames != "all":
            check_untrained(model.records, capture, cameras, frames)
        if isinstance(model, TrainedHead):
            part = head_in(PartOfCapture(capture, cameras, frames), model.over_torso)
            return evaluate_head(model, part, frames, self.images) | self._action_units()
        return self._body(model, capture, cameras)

    def _action_units(self) -> dict[str, float | None]:
        """AUE of the tables that were given."""
        from ico3d.measure.faces.action_units import action_unit_error, read_action_units

        if self.openface is None:
            return {"aue_lower": None, "aue_upper": None}
        error = action_unit_error(*map(read_action_units, self.openface))
        return {"aue_lower": error.lower, "aue_upper": error.upper}

    def _body(
        self,
        drawn: "TrainedBody | TrainedAvatar",
        capture: "Capture",
        cameras: tuple[int, ...],
    ) -> dict:
        """Measures a body, alone or with the head on it."""
        from dataclasses import replace

        from ico3d.avatar.avatar import BODY, TrainedAvatar
        from ico3d.body.model_folder import UNTUNED, TrainedBody
        from ico3d.measure.body import evaluate_body
        from ico3d.measure.methods.plots import plot_body

        with_head = isinstance(drawn, TrainedAvatar)
        body = drawn.body if with_head else drawn
        if self.untuned:
            folder = self.model / BODY if with_head else self.model
            body = TrainedBody.load(folder, UNTUNED).to(body.device)
            drawn = replace(drawn, body=body) if with_head else body
        metrics = evaluate_body(body, capture, cameras, images=self.images, drawn=drawn)
        if self.plots is not None:
            plot_body(metrics, self.plots)
        return metrics


SCENES = ((5_000, 256), (20_000, 256), (50_000, 512), (100_000, 1024), (200_000, 1024))
"""Numbers of Gaussians and picture sizes of the scenes of `ico3d bench raster`."""


@dataclass(frozen=True)
class BenchRaster:
    """Times the CPU rasteriser against another program on the same projected Gaussians.

    Attributes:
        against: Python script of the other program; it is executed, so name only one that you
            trust.
        json: File for the figures.
        n: Number of Gaussians of a single scene; by default there are five, from 5,000 to 200,000.
        size: Image width and height of the single scene in pixels, a multiple of 16.
        runs: Number of repetitions; medians are reported.
        threads: Threads of each program.
    """

    against: Path
    json: Path | None = None
    n: int | None = None
    size: int = 256
    runs: int = 40
    threads: int = 2

    def run(self) -> None:
        """Prints the table and writes the file."""
        import json
        import os

        # Both read these when their thread pools come up, which is after this line.
        os.environ["OMP_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = str(self.threads)

        from rich.console import Console
        from rich.progress import track
        from rich.table import Table

        from ico3d.common.files import write_atomic
        from ico3d.measure.raster import compare

        scenes = SCENES if self.n is None else ((self.n, self.size),)
        turns = track(scenes, "drawing", transient=True)
        results = [compare(self.against, n, size, self.runs) for n, size in turns]
        if self.json is not None:
            figures = {f"ratio_{result.name}": result.ratio for result in results}
            figures |= {"threads": self.threads, "scenes": [r.figures() for r in results]}
            write_atomic(self.json, json.dumps(figures, indent=1).encode())
        table = Table("scene", "pairs", "ours", "theirs", "forward", "backward", "all", "ns/pair")
        for r in results:
            ratios = (r.forward_ratio, r.backward_ratio, r.ratio)
            table.add_row(
                *(r.name, f"{r.pairs:,}", f"{r.ours_total_ms:.1f}", f"{r.theirs_total_ms:.1f}"),
                *(f"{ratio:.2f}" for ratio in ratios),
                f"{1e6 * r.ours_total_ms / r.pairs:.0f}",
            )
        console = Console()
        console.print(table)
        console.print(
            "Milliseconds of binning, drawing and gradients; ratios are ours / theirs; pairs of "
            "splats and tiles.\nGreatest difference of the pictures "
            f"{max(r.image_difference for r in results):.1e}, of the gradients "
            f"{max(r.gradient_difference for r in results):.1e} (relative)."
        )


@dataclass(frozen=True)
class BenchExpression:
    """Measures the mouth: speed, streaming, silence, and lips against recordings of people.

    The avatar's speech model and every installed encoder are measured.

    Attributes:
        speech: Folder with WAV files and a README.md whose table lists names and words.
        bundle: An avatar driven by speech; `demo` is the avatar of the package.
        random: Encoders to time with random weights if their own are not installed.
        json: File for the figures.
    """

    speech: Path
    bundle: Path = Path("demo")
    random: tuple[Literal["ave", "hubert"], ...] = ("ave",)
    json: Path | None = None

    def run(self) -> None:
        """Prints the table and writes the file."""
        import json

        from rich.console import Console
        from rich.table import Table

        from ico3d.bundle.format import Bundle
        from ico3d.bundle.packaged import bundle_path
        from ico3d.common.files import write_atomic
        from ico3d.measure.expression import bench

        figures = bench(self.speech, Bundle.open(bundle_path(self.bundle)), self.random)
        if self.json is not None:
            write_atomic(self.json, json.dumps(figures, indent=1).encode())
        columns = ("x real time", "160 ms", "differs", "silence", "lips: r", "lag (ms)")
        table = Table("", *columns, box=None)
        table.columns[0].no_wrap = True
        for name, found in figures.items():
            lips = [
                " ".join(f"{value:.{digits}f}" for value in (found[key] or {}).values())
                for key, digits in (("lip_correlation", 2), ("lip_lag_ms", 0))
            ]
            still = max(found["silence_opening"].values())
            speeds = (found[f"real_time_factor{which}"] for which in ("", "_slices"))
            difference = f"{found['streaming_difference']:.0e}"
            figures_of = (*(f"{speed:.3g}" for speed in speeds), difference, f"{still:.3f}")
            table.add_row(name, *figures_of, *lips)
        console = Console()
        console.print(table)
        console.print(
            "x real time: seconds of sound per second of one core, in steps of 600 and of 160 ms; "
            "differs: slices from the whole; silence: the mouth from rest, of its way in speech; "
            "r and lag for each recording."
        )
