"""A live page that shows a training in the browser, served by viser.

viser answers the browser on its own threads. Those threads only set flags; everything that touches
the model happens in `after_step`, on the training thread.
"""

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from ico3d.common.camera import Camera
from ico3d.common.spread import spread
from ico3d.errors import MissingExtraError
from ico3d.splat import harmonics, quaternions
from ico3d.splat.gaussians import Gaussians

HOST = "127.0.0.1"

PERIOD = 1.0
"""Seconds between two updates of the page."""
ANSWER = 0.1
"""Shortest time in seconds between two pictures while a visitor moves something."""

RADIUS = 10.0
"""Size at which the page shows the scene, in viser's units.

viser stores covariances as 16-bit floats, which cannot represent a Gaussian of half a millimetre in
metres.
"""
LARGEST = 200.0
"""Longest standard deviation in viser's units, also because of 16-bit covariances."""

UP_SAMPLES = 50
"""Number of cameras from which the upward direction is estimated."""


@dataclass(frozen=True)
class Slider:
    """A number that visitors of the page can change.

    Attributes:
        name: Label of the slider.
        low: Smallest value.
        high: Largest value.
    """

    name: str
    low: float
    high: float


class Watchable(Protocol):
    """A model in training as the page needs it: Gaussians for each frame of the recording.

    Attributes:
        frames: Number of frames to choose from.
        sliders: Inputs of the model, besides the frame, that visitors can change.
    """

    frames: int
    sliders: Sequence[Slider]

    def camera(self, frame: int) -> Camera:
        """A camera that recorded the frame, in the space of the Gaussians."""
        ...

    def values(self, frame: int) -> Mapping[str, float]:
        """The values of the sliders in a frame of the recording."""
        ...

    def gaussians(self, frame: int, values: Mapping[str, float]) -> Gaussians:
        """The Gaussians of a frame, with the sliders at `values`."""
        ...

    def pictures(self, frame: int) -> tuple[Tensor, Tensor]:
        """The recorded picture of a frame and its rendering, (H, W, 3) each."""
        ...


class LivePage:
    """An observer of a training that shows the model in the browser during a `with` block."""

    def __init__(self, subject: Watchable, port: int):
        """Serves on this port of 127.0.0.1, or on the next free one.

        Raises:
            MissingExtraError: If viser is not installed.
        """
        try:
            import viser
        except ImportError as error:
            raise MissingExtraError("viser", "watch", "watching a training run") from error
        self._subject = subject
        self._changed, self._running = threading.Event(), threading.Event()
        self._running.set()
        self._updated, self._frame_shown = 0.0, 0
        self.server = viser.ViserServer(HOST, port, label="ico3d", verbose=False)
        # Anybody who reaches the page could have viser open a tunnel to it from the internet.
        self.server.request_share_url = lambda verbose=True: None
        self.server.gui.configure_theme(show_share_button=False, control_width="large")
        self.server.on_client_connect(lambda _: self._changed.set())
        first = subject.gaussians(0, subject.values(0))
        self._center, self._scale = _placed(first)
        self._stand()
        self._splats = self.server.scene.add_gaussian_splats("/gaussians", *self._arrays(first))
        self._build_panel()

    def __enter__(self) -> "LivePage":
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stops serving."""
        self.server.stop()

    def after_step(self, done: int, values: Mapping[str, float | Tensor]) -> None:
        """Updates the page if an update is due and somebody is connected; waits while paused."""
        self._update_if_due(done, values)
        while not self._running.is_set():
            time.sleep(ANSWER)
            self._update_if_due(done, values)

    def _update_if_due(self, done: int, values: Mapping[str, float | Tensor]) -> None:
        if not self.server.get_clients():
            return
        waited = time.monotonic() - self._updated
        asked = self._changed.is_set() and waited >= ANSWER
        if asked or (self._running.is_set() and waited >= PERIOD):
            self._changed.clear()
            self._update(done, values)
            self._updated = time.monotonic()

    @torch.no_grad()
    def _update(self, done: int, values: Mapping[str, float | Tensor]) -> None:
        frame = self._frame.value
        if frame != self._frame_shown:
            self._set_sliders(frame)
            self._frame_shown = frame
        chosen = {name: slider.value for name, slider in self._sliders.items()}
        gaussians = self._subject.gaussians(frame, chosen)
        with self.server.atomic():
            self._splats.set_gaussians(*self._arrays(gaussians))
            self._pictures.image = _side_by_side(*self._subject.pictures(frame))
            self._numbers.content = _table({"step": done, **values})

    def _build_panel(self) -> None:
        gui, subject = self.server.gui, self._subject
        self._numbers = gui.add_markdown("waiting for the first step")
        self._button = gui.add_button("Pause")
        self._button.on_click(lambda _: self._toggle())
        self._frame = gui.add_slider("frame", 0, max(subject.frames - 1, 1), 1, 0)
        self._frame.on_update(lambda _: self._changed.set())
        self._pictures = gui.add_image(
            _side_by_side(*subject.pictures(0)), label="recorded | rendered", jpeg_quality=90
        )
        self._sliders = {}
        if not subject.sliders:
            return
        with gui.add_folder("expression"):
            for slider in subject.sliders:
                step = (slider.high - slider.low) / 100
                handle = gui.add_slider(slider.name, slider.low, slider.high, step, slider.low)
                handle.on_update(lambda _: self._changed.set())
                self._sliders[slider.name] = handle
        self._set_sliders(0)

    def _set_sliders(self, frame: int) -> None:
        """Puts the sliders where the frame has them."""
        values = self._subject.values(frame)
        for slider in self._subject.sliders:
            value = min(max(values[slider.name], slider.low), slider.high)
            self._sliders[slider.name].value = round(value, 3)

    def _toggle(self) -> None:
        """Pauses or goes on."""
        paused = self._running.is_set()
        self._button.label = "Resume" if paused else "Pause"
        (self._running.clear if paused else self._running.set)()

    def _stand(self) -> None:
        """Puts the browser's camera where the first frame's stood, the right way up."""
        camera = self._subject.camera(0)
        eye, forward = camera.camera_to_world[:3, 3], camera.camera_to_world[:3, 2]
        depth = float((self._center - eye) @ forward)
        view = self.server.initial_camera
        self.server.scene.set_up_direction(_up(self._subject))
        view.position = self._scale * eye
        view.look_at = self._scale * (eye + max(depth, 1e-3) * forward)
        view.fov = float(2 * np.arctan(camera.height / 2 / camera.intrinsics[1, 1]))

    def _arrays(self, gaussians: Gaussians) -> tuple[np.ndarray, ...]:
        """Centres (N, 3), covariances (N, 3, 3), colours (N, 3) and opacities (N, 1) for viser."""
        deviations = (self._scale * gaussians.scales).clamp_max(LARGEST)  # (N, 3)
        axes = quaternions.to_matrix(gaussians.quats) * deviations[:, None]  # (N, 3, 3)
        colors = gaussians.colors
        if colors is None:
            assert gaussians.sh is not None
            colors = 0.5 + harmonics.C0 * gaussians.sh[:, 0]  # (N, 3)
        tensors = (
            self._scale * gaussians.means,
            axes @ axes.mT,
            colors,
            gaussians.opacities[:, None],
        )
        return tuple(tensor.detach().float().cpu().numpy() for tensor in tensors)


def _placed(gaussians: Gaussians) -> tuple[np.ndarray, float]:
    """The middle (3,) of Gaussians, and the factor that makes most of them fit in `RADIUS`."""
    means = gaussians.means.detach().cpu().double().numpy()
    center = np.median(means, 0)  # (3,)
    radius = np.quantile(np.linalg.norm(means - center, axis=1), 0.9)
    return center, RADIUS / max(float(radius), 1e-6)


def _up(subject: Watchable) -> np.ndarray:
    """(3,) where the cameras of the frames have up, on average."""
    frames = spread(subject.frames, UP_SAMPLES)
    downs = [subject.camera(frame).world_to_camera[1, :3] for frame in frames]
    up = -np.mean(downs, 0)
    return up / max(float(np.linalg.norm(up)), 1e-6)


def _side_by_side(recorded: Tensor, rendered: Tensor) -> np.ndarray:
    """(H, 2·W, 3) bytes of two pictures."""
    both = torch.cat([recorded.cpu(), rendered.cpu()], 1)  # (H, 2·W, 3)
    return (both.clamp(0, 1) * 255 + 0.5).to(torch.uint8).numpy()


def _table(numbers: Mapping[str, float | Tensor]) -> str:
    """The numbers as Markdown."""
    heads, values = zip(*((name, f"{float(n):.5g}") for name, n in numbers.items()), strict=True)
    rows = (heads, ["---"] * len(heads), values)
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)
