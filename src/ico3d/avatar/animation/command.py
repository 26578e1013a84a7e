"""The verb `ico3d animate`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from ico3d.common.device import DeviceName

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ico3d.avatar.animation.animated import Person
    from ico3d.avatar.animation.clip_sheet import Named
    from ico3d.avatar.animation.keyframes import Motion
    from ico3d.bundle.animation import Action, Animation
    from ico3d.capture.capture import Capture

PICTURES = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True)
class Animate:
    """Finds the rest loop of a body and the key frames of its gestures, or shows those it has.

    A bundle contains this animation. A model folder has none until --out writes it there as
    animation.json; then it can be edited by hand (actions and their scores: higher ones are
    visited more often; the ends of the rest loop; the speeds), looked at with --contact-sheet, and
    ico3d bake puts it into the bundle.

    A body on a skeleton also has clips: what the person did in the recording, cut and named by
    rule. --clips writes them as text, where names and frames can be corrected, and clips deleted or
    added; this verb, ico3d bake and ico3d render read that file.

    With --capture, frames are compared with the recording, part by part of the body. Gestures that
    cannot be reached without frames that fall far below the clip's own quality are refused, here
    and by ico3d bake.

    Attributes:
        model: A folder of ico3d train body or ico3d assemble, or a bundle.
        out: The file to write, usually MODEL/animation.json.
        clips: The file to write with the clips of a body on a skeleton, usually MODEL/clips.toml.
        contact_sheet: Picture to draw, NAME.jpg or NAME.png: the rest loop's ends, the actions and
            the clips from the front, and how fast the hands are.
        capture: The body's recording, to measure how the motion looks. The contact sheet then
            shows the person from the side of its first camera; without a capture, avatars and
            bundles are shown from their front, and bodies from +z in a world with y up.
        device: Where to compute: by default with CUDA where that works, else on the CPU.
    """

    model: tyro.conf.Positional[Path]
    out: Path | None = None
    clips: Path | None = None
    contact_sheet: Path | None = None
    capture: Path | None = None
    device: DeviceName = "auto"

    def run(self) -> None:
        """Finds key frames and clips, prints them, and writes the files that were asked for.

        Raises:
            ModelError: If the path holds no model that can be animated, or a damaged one.
            BundleError: If the bundle has no body, the animation makes no sense, or no stretch of
                the rest loop looks nearly as good as the clip.
            CaptureError: If the capture is the recording of another body.
            SettingsError: If the contact sheet is not named .jpg or .png, the body has no skeleton
                for --clips, or its clips.toml makes no sense.
        """
        from rich.console import Console
        from rich.progress import track

        from ico3d.avatar.animation.animated import open_person
        from ico3d.avatar.animation.keyframes import (
            Motion,
            find_actions,
            find_animation,
            window_places,
        )
        from ico3d.avatar.animation.motion_quality import in_words, playable, refused
        from ico3d.capture.formats import open_capture
        from ico3d.common.files import write_atomic
        from ico3d.errors import SettingsError
        from ico3d.splat.device import computing_device

        if self.contact_sheet and self.contact_sheet.suffix.lower() not in PICTURES:
            raise SettingsError(f"{self.contact_sheet}: a contact sheet is NAME.jpg or NAME.png.")
        person = open_person(self.model, computing_device(self.device))
        capture = open_capture(self.capture) if self.capture else None
        places = track(
            window_places(person), "measuring motion", len(person.windows), transient=True
        )
        motion = Motion.of(person, places)
        proposed = _with_quality(person.animation or find_animation(motion), person, capture)
        animation, left_out = playable(proposed), ()
        console = Console()
        if proposed.quality:
            candidates = (*find_actions(motion, proposed.rest), *proposed.actions)
            left_out = refused(candidates, animation)
            console.print(in_words(animation, len(left_out)))
        console.print(table(animation, motion, left_out))
        clips = self._clips(person)
        if clips:
            console.print(clip_table(clips, animation.fps))
        if self.out:
            write_atomic(self.out, animation.to_bytes())
        if self.contact_sheet:
            self._draw(person, animation, motion, left_out, capture, clips)

    def _clips(self, person: "Person") -> "Named":
        """Recorded clips with their names, empty without a skeleton; writes the file of --clips."""
        from ico3d.common.files import write_atomic
        from ico3d.errors import SettingsError
        from ico3d.motion.recorded.cut import named, to_toml
        from ico3d.motion.recorded.cutting import find_cuts

        recording = person.recording
        if recording is None:
            if self.clips:
                raise SettingsError(
                    f"{self.model} has no skeleton of a person: clips are cut from a body that was "
                    "trained with --method skinned."
                )
            return []
        cuts = find_cuts(recording) if person.cuts is None else person.cuts
        if self.clips:
            text = to_toml(cuts, recording.fps, recording.num_frames)
            write_atomic(self.clips, text.encode())
        return named(cuts)

    def _draw(
        self,
        person: "Person",
        animation: "Animation",
        motion: "Motion",
        left_out: "Sequence[Action]",
        capture: "Capture | None",
        clips: "Named",
    ) -> None:
        from ico3d.avatar.animation.sheet import draw_sheet

        assert self.contact_sheet is not None
        cameras = capture.cameras if capture else None
        draw_sheet(person, animation, motion, left_out, cameras, self.contact_sheet, clips)


def _with_quality(
    animation: "Animation", person: "Person", capture: "Capture | None"
) -> "Animation":
    """The animation with each frame's quality, measured where there is a recording."""
    from dataclasses import replace

    from rich.progress import track

    from ico3d.avatar.animation.motion_quality import measure_motion
    from ico3d.body.planning.windows import Window

    if capture is None:
        return animation
    quality = measure_motion(
        lambda tau: person.gaussians(tau * person.seconds),
        (lambda tau: person.body_gaussians(tau * person.seconds)) if person.has_head else None,
        capture,
        Window(0, person.windows[-1].last),
        lambda frames: track(list(frames), "comparing pictures", transient=True),
    )
    return replace(animation, quality=quality)


def table(animation: "Animation", motion: "Motion", left_out: "Sequence[Action]" = ()):
    """The key frames as a table for the terminal, in the order of time.

    Args:
        animation: The rest loop and the actions that are played.
        motion: How the body moves.
        left_out: Actions that are refused because they, or the frames on the way, look bad.
    """
    from rich.table import Table

    shown = Table("frame", "time s", "what", "score", "hands m/s", "from rest m")
    if animation.quality:
        shown.add_column("picture dB")
    rest = animation.rest
    rows = [(rest.start, "rest start", ""), (rest.end, "rest end", "")]
    rows += [(action.frame, "action", f"{action.score:.3f}") for action in animation.actions]
    rows += [(action.frame, "refused", f"{action.score:.3f}") for action in left_out]
    for frame, what, score in sorted(rows):
        speed, away = motion.speeds[frame], motion.away(frame, rest.end)
        time = f"{frame / animation.fps:.2f}"
        picture = [f"{animation.quality[frame]:.1f}"] if animation.quality else []
        shown.add_row(str(frame), time, what, score, f"{speed:.3f}", f"{away:.3f}", *picture)
    return shown


def clip_table(clips: "Named", fps: float):
    """Recorded clips as a table for the terminal.

    Args:
        clips: Clips with their names.
        fps: Frames per second of the recording.
    """
    from rich.table import Table

    shown = Table("clip", "hands", "first", "stroke", "release", "last", "time s")
    for name, cut in clips:
        frames = map(str, (cut.first, cut.stroke, cut.release, cut.last))
        shown.add_row(name, cut.hands, *frames, f"{cut.stroke / fps:.2f}")
    return shown
