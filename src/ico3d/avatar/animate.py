"""The verb `ico3d animate`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from ico3d.common.device import DeviceName

if TYPE_CHECKING:
    from ico3d.avatar.animated import Person
    from ico3d.avatar.keyframes import Motion
    from ico3d.bundle.animation import Animation

PICTURES = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True)
class Animate:
    """Finds where a body rests and the key frames of its gestures, or shows those it has.

    A bundle has its own. Folders of models have none until somebody writes one there with --out:
    it can be edited by hand (add or remove actions, change their scores: those with higher ones
    are visited more often; the ends of the rest loop; the speeds), looked at with --contact-sheet,
    and goes into the bundle.

    Attributes:
        model: A folder of ico3d train body or ico3d assemble, or a bundle.
        out: The file to write, usually MODEL/animation.json.
        contact_sheet: Draw it here, NAME.jpg or NAME.png: the rest loop's ends and the actions
            from the front, and how fast the hands are.
        capture: See a body from the side of the first camera of its capture; without, as someone
            stands before it in a world with y up. Avatars and bundles know their front.
        device: Where to compute: by default with CUDA where that works, else on the CPU.
    """

    model: tyro.conf.Positional[Path]
    out: Path | None = None
    contact_sheet: Path | None = None
    capture: Path | None = None
    device: DeviceName = "auto"

    def run(self) -> None:
        """Finds, prints, writes and draws.

        Raises:
            ModelError: If a folder holds a damaged model.
            BundleError: If there is no body, or its animation makes no sense.
            SettingsError: If the contact sheet would be no picture.
        """
        from rich.console import Console
        from rich.progress import track

        from ico3d.avatar.animated import open_person
        from ico3d.avatar.keyframes import Motion, find_animation, window_places
        from ico3d.common.files import write_atomic
        from ico3d.errors import SettingsError
        from ico3d.splat.device import computing_device

        if self.contact_sheet and self.contact_sheet.suffix.lower() not in PICTURES:
            raise SettingsError(f"{self.contact_sheet}: a contact sheet is NAME.jpg or NAME.png.")
        person = open_person(self.model, computing_device(self.device))
        places = track(
            window_places(person), "measuring motion", len(person.windows), transient=True
        )
        motion = Motion.of(person, places)
        animation = person.animation or find_animation(motion)
        Console().print(table(animation, motion))
        if self.out:
            write_atomic(self.out, animation.to_bytes())
        if self.contact_sheet:
            self._draw(person, animation, motion, self.contact_sheet)

    def _draw(self, person: "Person", animation: "Animation", motion: "Motion", path: Path) -> None:
        from ico3d.avatar.animation_sheet import draw_sheet
        from ico3d.capture.capture import Capture

        cameras = Capture.open(self.capture).cameras if self.capture else None
        draw_sheet(person, animation, motion, cameras, path)


def table(animation: "Animation", motion: "Motion"):
    """The key frames as a table for the terminal, in the order of time."""
    from rich.table import Table

    shown = Table("frame", "time s", "what", "score", "hands m/s", "from rest m")
    rest = animation.rest
    rows = [(rest.start, "rest start", ""), (rest.end, "rest end", "")]
    rows += [(action.frame, "action", f"{action.score:.3f}") for action in animation.actions]
    for frame, what, score in sorted(rows):
        speed, away = motion.speeds[frame], motion.away(frame, rest.end)
        time = f"{frame / animation.fps:.2f}"
        shown.add_row(str(frame), time, what, score, f"{speed:.3f}", f"{away:.3f}")
    return shown
