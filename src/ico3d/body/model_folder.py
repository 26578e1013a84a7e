"""A trained body, and the model folder that holds it."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import get_args

import torch

from ico3d.body.checking import check_window
from ico3d.body.motion.window_model import WindowModel
from ico3d.body.opening import motion_from
from ico3d.body.planning.windows import Window
from ico3d.body.settings import Method
from ico3d.capture.parts.trained_on import check_told
from ico3d.common.files import json_of, resolved, write_atomic
from ico3d.errors import ModelError, SettingsError
from ico3d.splat.gaussians import Gaussians
from ico3d.training.checkpoint import DAMAGED, load_tensors, save_tensors

ABOUT = "body.json"
"""Name of the file that marks a folder as a body's."""
UNTUNED = "untuned.json"
"""Name of the file that lists the windows before temporal fine-tuning, if there was one."""
CAMERA_COLORS = "camera_colors"
"""Name of the tensor of a window's file that says how the cameras' colours differ."""
MOST_FRAMES = 100_000
"""Longest clip that is believed, an hour at 25 frames per second: some verbs draw every frame."""
ROUNDING = 1e-6
"""Tolerance in frames for times that stand for whole frames: (31 / 15 s) · 15 may exceed 31."""


def save_window(file: Path, model: WindowModel) -> None:
    """Writes the model of one window."""
    named = {f"gaussians.{name}": tensor for name, tensor in model.gaussians.items()}
    named |= {f"shared.{name}": tensor for name, tensor in model.shared.items()}
    if model.camera_colors is not None:
        named[CAMERA_COLORS] = model.camera_colors
    save_tensors(file, named, model.motion.about())


def load_window(file: Path) -> WindowModel:
    """Reads the model of one window, as `save_window` wrote it, onto the CPU.

    Raises:
        ModelError: If the file is missing or damaged.
    """
    tensors, about = load_tensors(file)
    parts: dict[str, dict] = {"gaussians": {}, "shared": {}}
    colors = tensors.pop(CAMERA_COLORS, None)
    try:
        for name, tensor in tensors.items():
            part, _, rest = name.partition(".")
            parts[part][rest] = tensor
        motion, shared = motion_from(about), parts["shared"]
        model = WindowModel(motion, parts["gaussians"], shared, colors)
        check_window(model)
        one = {name: tensor[:1] for name, tensor in parts["gaussians"].items()}
        WindowModel(motion, one, shared).at(0.0)  # better refused here than where it is drawn
        return model
    except (SettingsError, *DAMAGED) as error:
        raise ModelError(f"{file} does not hold a window of a body: {error}.") from error


@dataclass
class TrainedBody:
    """A trained body that can be drawn at any time of its clip.

    Attributes:
        models: The model of each window.
        windows: The frames of each window; neighbours share one frame.
        fps: Frames per second.
        method: The method that moves the Gaussians.
        summary: How the body was made: provenance of the capture, seconds of training, settings.
    """

    models: Sequence[WindowModel]
    windows: tuple[Window, ...]
    fps: float
    method: Method
    summary: dict

    @property
    def seconds(self) -> float:
        """Length of the clip in seconds."""
        return self.windows[-1].last / self.fps

    @property
    def records(self) -> list[dict]:
        """What trained the body, by `capture.parts.trained_on`; bodies it went on from included."""
        return [self.summary.get("recording", {}), *self.summary.get("continued", [])]

    def window_at(self, seconds: float) -> int:
        """Index of the window that shows a time; at a shared frame that of the earlier window."""
        frame = seconds * self.fps - ROUNDING
        inside = (i for i, window in enumerate(self.windows) if frame <= window.last)
        return next(inside, len(self.windows) - 1)

    def window_gaussians(self, index: int, tau: float) -> Gaussians:
        """Activated Gaussians of a window in the world, τ in [0, 1]."""
        return self.models[index].at(tau)

    def gaussians(self, seconds: float) -> Gaussians:
        """Activated Gaussians in the world at a time, which is clamped to the clip."""
        index = self.window_at(seconds)
        tau = self.windows[index].tau(seconds * self.fps)
        return self.window_gaussians(index, min(max(tau, 0.0), 1.0))

    @property
    def device(self) -> torch.device:
        """Device of the windows' tensors."""
        return self.models[0].device

    def to(self, device: torch.device) -> "TrainedBody":
        """Moves all windows to a device; returns this body."""
        for model in self.models:
            model.to(device)
        return self

    def save(self, folder: Path, files: Sequence[str], about: str = ABOUT) -> None:
        """Writes the list of windows; their models have to be written by `save_window`.

        Args:
            folder: The model folder.
            files: File of each window, relative to the folder.
            about: Name of the file to write, `ABOUT` or `UNTUNED`.
        """
        content = {
            "fps": self.fps,
            "method": self.method,
            "windows": [
                {**asdict(window), "file": file}
                for window, file in zip(self.windows, files, strict=True)
            ],
            "summary": self.summary,
        }
        write_atomic(folder / about, json.dumps(content, indent=1).encode())

    @classmethod
    def load(cls, folder: Path | str, about: str = ABOUT) -> "TrainedBody":
        """Reads a body onto the CPU.

        Args:
            folder: The model folder.
            about: Name of the file that lists the windows, `ABOUT` or `UNTUNED`.

        Raises:
            ModelError: If the folder holds no body, or a damaged one.
        """
        folder = Path(folder)
        try:
            content = json_of(folder / about)
            entries = content["windows"]
            windows = tuple(Window(int(e["first"]), int(e["last"])) for e in entries)
            files = [folder / str(entry["file"]) for entry in entries]
            found = [resolved(file) for file in files]
            inside = [file.is_relative_to(resolved(folder)) for file in found]
            fps, method = float(content["fps"]), content["method"]
            summary = content["summary"]
            _check_told(windows, fps, method, summary)
        except DAMAGED as error:
            raise ModelError(
                f"{folder} holds no body ({error}): train one with ico3d train body."
            ) from error
        if not all(inside):
            file = files[inside.index(False)]
            raise ModelError(f"{folder / about} names a file outside of its folder: {file}.")
        if len(set(found)) < len(found):
            raise ModelError(f"{folder / about} names a file for more than one window.")
        return cls([load_window(file) for file in files], windows, fps, method, summary)


def _check_told(windows: Sequence[Window], fps: float, method: object, summary: object) -> None:
    """Raises ValueError if what a folder tells of its body is impossible."""
    if not (math.isfinite(fps) and fps > 0):
        raise ValueError(f"it has {fps} frames per second")
    ends = [windows[0].first - 1] + [window.last for window in windows]
    ordered = all(a < b for a, b in pairwise(ends)) and all(len(window) > 0 for window in windows)
    if windows[0].first < 0 or not ordered:
        raise ValueError("its windows do not follow one another")
    if windows[-1].last >= MOST_FRAMES:
        raise ValueError(f"its clip has more than {MOST_FRAMES} frames")
    if method not in get_args(Method):
        raise ValueError("it has no method")
    check_told(summary)
