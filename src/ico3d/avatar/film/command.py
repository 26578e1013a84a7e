"""The verb `ico3d render`."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

if TYPE_CHECKING:
    from ico3d.avatar.film.film import Moving
    from ico3d.common.camera import Camera


@dataclass(frozen=True)
class Render:
    """Films a trained body from viewpoints where no camera stood.

    Time runs along with the camera; where the film is longer than the clip, back and forth.

    Attributes:
        model: A model folder that ico3d train body wrote.
        out: The video to write, NAME.mp4.
        capture: Orbit as the cameras of this capture stand around the person; without, level with
            a person in a world with y up.
        path: `orbit`, once around the person, or a JSON file with key cameras: {"cameras":
            [{"eye": [x, y, z], "target": [x, y, z], "up": [0, 1, 0], "fov_y": 40}, ...]}, metres
            and degrees; up and fov_y can be left out.
        seconds: How long the film lasts.
        fps: Pictures per second.
        size: Width and height in pixels, even numbers.
        background: Colour behind the person, as in HTML: a name or #rrggbb.
    """

    model: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    capture: Path | None = None
    path: str = "orbit"
    seconds: float = 8.0
    fps: float = 30.0
    size: tuple[int, int] = (540, 960)
    background: str = "#d6dbe0"

    def run(self) -> None:
        """Renders and writes the video.

        Raises:
            SettingsError: If the settings make no sense.
            ModelError: If there is no body.
        """
        from rich.console import Console
        from rich.progress import track

        from ico3d.avatar.film.film import pictures
        from ico3d.avatar.film.video import write_video
        from ico3d.body.trained import TrainedBody

        background = self._checked()
        body = TrainedBody.load(self.model)
        cameras = self._cameras(body)
        seen: Iterable = pictures(body, cameras, self.fps, background)
        shown = track(seen, "filming", len(cameras), transient=True)
        write_video(self.out, shown, self.size, self.fps)
        Console().print(f"{self.out}: {len(cameras)} pictures at {self.fps:g} per second.")

    def _checked(self) -> tuple[float, ...]:
        """The background's colour in [0, 1], when all the rest is sound too."""
        from PIL import ImageColor

        from ico3d.errors import SettingsError

        if any(side < 2 or side % 2 for side in self.size):
            raise SettingsError("--size needs an even width and height: H.264 has no others.")
        if not (self.seconds > 0 and 0 < self.fps <= 1000 and self.seconds * self.fps >= 1):
            raise SettingsError("--seconds and --fps must be above 0 and make one picture or more.")
        if self.out.suffix != ".mp4":
            raise SettingsError(f"{self.out}: a film is written to a file NAME.mp4.")
        try:
            red, green, blue, *_ = ImageColor.getrgb(self.background)
        except ValueError as error:
            raise SettingsError(f"--background: {error}.") from error
        return red / 255, green / 255, blue / 255

    def _cameras(self, person: "Moving") -> list["Camera"]:
        """One for each picture."""
        from ico3d.avatar.film import camera_path
        from ico3d.avatar.film.film import extent
        from ico3d.capture.capture import Capture

        count = round(self.seconds * self.fps)
        if self.path != "orbit":
            keys = camera_path.read_key_cameras(Path(self.path), *self.size)
            return camera_path.through(keys, count)
        points = extent(person)
        if self.capture is None:
            ring = camera_path.ring_around(points)
        else:
            ring = camera_path.ring_of(Capture.open(self.capture).cameras, points)
        return camera_path.orbit(ring, points, count, *self.size)
