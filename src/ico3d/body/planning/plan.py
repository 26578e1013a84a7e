"""The plan of windows in which a clip is trained, made and shown before any training."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from ico3d.body.planning.flow import clip_flow
from ico3d.body.planning.windows import Window, cut
from ico3d.body.settings import Windows
from ico3d.capture.capture import Capture
from ico3d.common.files import holds, write_atomic

BLOCKS = "▁▂▃▄▅▆▇█"
"""Characters of the motion curve in the terminal, from least to most."""

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True)
class Plan:
    """The windows of a clip, and the motion by which it was cut.

    Attributes:
        windows: Windows from the first to the last frame; neighbours share one frame.
        motion: Motion of each step from one frame to the next, cm² (`ClipFlow.motion`).
        method: Name of the flow method that measured the motion.
        fps: Frames per second.
        busiest: Index of the camera that saw most motion.
        settings: Settings by which the clip was cut.
    """

    windows: tuple[Window, ...]
    motion: tuple[float, ...]
    method: str
    fps: float
    busiest: int
    settings: Windows

    def moved(self, window: Window) -> float:
        """Sum of the motion of a window's steps, cm²."""
        return float(sum(self.motion[window.first : window.last]))


def make_plan(
    capture: Capture,
    settings: Windows,
    folder: Path,
    device: "torch.device | str" = "cpu",
) -> Plan:
    """Measures the motion of a clip and cuts the clip into windows.

    Args:
        capture: The recording.
        settings: Bounds of the windows.
        folder: Model folder; measured flow is cached in `flow/` below it.
        device: Where flow is estimated, if the method can.

    Raises:
        CaptureError: If motion cannot be measured.
        MissingExtraError: If no flow method is installed.
        SettingsError: If the settings contradict one another.
    """
    flow = clip_flow(capture, folder / "flow", device=device)
    windows = cut(flow.motion, settings.threshold, settings.shortest, settings.longest)
    sums = [np.nansum(one.energy) for one in flow.cameras]
    busiest = flow.cameras[int(np.argmax(sums))].index
    motion = tuple(flow.motion.tolist())
    return Plan(windows, motion, flow.method, capture.fps, busiest, settings)


def save_plan(plan: Plan, path: Path) -> None:
    """Writes a plan as JSON."""
    write_atomic(path, _written(plan))


def is_saved(plan: Plan, path: Path) -> bool:
    """Whether a file holds exactly this plan."""
    return holds(path, _written(plan))


def _written(plan: Plan) -> bytes:
    return json.dumps(asdict(plan), indent=1).encode()


def print_plan(plan: Plan, console: Console) -> None:
    """Prints a table of the windows, with the motion curve in block characters."""
    settings = plan.settings
    table = Table(
        "",
        "frames",
        "seconds",
        "count",
        "moves, cm²",
        "motion",
        title=f"{len(plan.windows)} windows of {settings.shortest} to {settings.longest} frames, "
        f"up to {settings.threshold:g} cm² ({plan.method})",
        title_justify="left",
    )
    peak = max(plan.motion, default=0.0)
    for number, window in enumerate(plan.windows):
        table.add_row(
            str(number),
            f"{window.first} – {window.last}",
            f"{window.first / plan.fps:.2f} – {window.last / plan.fps:.2f}",
            str(len(window)),
            f"{plan.moved(window):.1f}",
            "".join(_block(m, peak) for m in plan.motion[window.first : window.last]),
        )
    console.print(table)


def _block(motion: float, peak: float) -> str:
    """A block as high as the square root of motion over peak, which makes slow motion visible."""
    share = np.sqrt(motion / peak) if peak > 0 else 0.0
    return BLOCKS[min(int(share * len(BLOCKS)), len(BLOCKS) - 1)]
