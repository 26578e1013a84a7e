"""The verb `ico3d render`."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from ico3d.common.device import DeviceName

if TYPE_CHECKING:
    import torch

    from ico3d.avatar.film.actor import Actor
    from ico3d.avatar.moving import Moving
    from ico3d.avatar.poseable import Poseable
    from ico3d.capture.capture import Capture, Sound
    from ico3d.common.camera import Camera

ORBIT, START, PORTRAIT = "orbit", "start", "portrait"
"""Camera paths that can be asked for by name."""
GREY = (0.84, 0.855, 0.88)
"""Background behind a body alone."""


@dataclass(frozen=True)
class Render:
    """Films a person who talks, or a recorded motion, from where no camera stood.

    With --audio, lips follow the sound, the body gestures, and the film is as long as the sound.
    Without it, the recorded motion is played; a film that is longer than the clip plays it back and
    forth. A person on a skeleton is not bound to the clip: with --audio they gesture on the stress
    of speech, and --gestures names gestures to make.

    Attributes:
        model: A bundle, which is shown as it was baked (`demo` is the one of the package), or a
            model folder of ico3d assemble or ico3d train body, which is shown by the exact model.
        out: The video to write, NAME.mp4.
        audio: Sound file with what the person says: WAV, FLAC or MP3.
        text: What is said in the sound, so that a person on a skeleton can gesture what words mean.
        gestures: Gestures that a person on a skeleton makes one after the other, such as `wave
            point open_hands`; the film lasts as long as they take. The error about an unknown name
            lists all names.
        capture: Orbit at the distance and height of this capture's cameras; without it, around the
            middle of a person in a world with y up. For a folder of ico3d assemble it is the body's
            recording.
        path: `orbit`, once around the person; `portrait`, before head and chest for the whole film;
            `start`, where visitors stand; or a JSON file with key cameras: {"cameras": [{"eye": [x,
            y, z], "target": [x, y, z], "up": [0, 1, 0], "fov_y": 40}, ...]}, metres and degrees; up
            and fov_y can be left out. The default is `portrait` with --audio, `start` with
            --gestures, and `orbit` without both or for a body alone.
        seconds: Length of a film without --audio and --gestures.
        fps: Pictures per second.
        size: Width and height in pixels, even numbers; one number for a square.
        background: Colour behind the person, as in HTML: a name or #rrggbb; by default the
            bundle's own, the mean background of the capture, or a light grey.
        ai_mark: Burn "AI" into a corner of the pictures; without it, say otherwise that a machine
            made them.
        seed: Seed of blinks and gestures.
        device: Where to compute: by default with CUDA where that works, else on the CPU.
    """

    model: tyro.conf.Positional[Path]
    out: tyro.conf.Positional[Path]
    audio: Path | None = None
    text: str = ""
    gestures: tuple[str, ...] = ()
    capture: Path | None = None
    path: str | None = None
    seconds: float = 8.0
    fps: float = 30.0
    size: Annotated[tuple[int, ...], tyro.conf.arg(metavar="W [H]")] = (540, 960)
    background: str | None = None
    ai_mark: bool = True
    seed: int = 0
    device: DeviceName = "auto"

    def run(self) -> None:
        """Renders and writes the video.

        Raises:
            SettingsError: If the options make no sense or do not fit the model.
            ModelError: If the model is none that can be filmed.
            BundleError: If the bundle fails a check.
            CaptureError: If the sound cannot be read, or --capture does not fit the person.
        """
        from rich.console import Console
        from rich.progress import track

        from ico3d.avatar.film.film import pictures
        from ico3d.avatar.film.mark import marked
        from ico3d.avatar.film.video import write_video
        from ico3d.splat.device import computing_device

        background, device = self._checked(), computing_device(self.device)
        sound = self._sound()
        person, actor = self._person(sound, device)
        if background is None:
            background = GREY if actor is None else actor.background
        timed = sound is not None or self.gestures
        seconds = person.seconds if timed else self.seconds
        cameras = self._cameras(person, actor, max(1, round(seconds * self.fps)))
        backdrop = None if actor is None else actor.backdrop
        seen: Iterable = pictures(person, cameras, self.fps, background, backdrop, device)
        if self.ai_mark:
            seen = marked(seen, self._sides)
        shown = track(seen, "filming", len(cameras), transient=True)
        write_video(self.out, shown, self._sides, self.fps, sound)
        Console().print(f"{self.out}: {len(cameras)} pictures at {self.fps:g} per second.")

    @property
    def _sides(self) -> tuple[int, int]:
        return self.size[0], self.size[-1]

    def _checked(self) -> tuple[float, ...] | None:
        """Checks the options; returns RGB in [0, 1] of --background, None if not given.

        Raises:
            SettingsError: If an option makes no sense.
        """
        from PIL import ImageColor

        from ico3d.errors import SettingsError

        if not 1 <= len(self.size) <= 2 or any(side < 2 or side % 2 for side in self.size):
            raise SettingsError("--size needs an even width and height: H.264 has no others.")
        if not (self.seconds > 0 and 0 < self.fps <= 1000 and self.seconds * self.fps >= 1):
            raise SettingsError("--seconds and --fps must be above 0 and make one picture or more.")
        if self.audio and self.gestures:
            raise SettingsError("--gestures and --audio: who talks gestures as the words ask for.")
        if self.out.suffix != ".mp4":
            raise SettingsError(f"{self.out}: a film is written to a file NAME.mp4.")
        if self.background is None:
            return None
        try:
            red, green, blue, *_ = ImageColor.getrgb(self.background)
        except ValueError as error:
            raise SettingsError(f"--background: {error}.") from error
        return red / 255, green / 255, blue / 255

    def _sound(self) -> "Sound | None":
        from ico3d.avatar.film.video import SOUND_RATE
        from ico3d.capture.sound import read_sound_file
        from ico3d.errors import SettingsError

        if self.audio is None:
            return None
        sound = read_sound_file(self.audio, SOUND_RATE)
        if sound is None or len(sound.samples) == 0:
            raise SettingsError(f"--audio: there is no sound in {self.audio}.")
        return sound

    def _person(
        self, sound: "Sound | None", device: "torch.device"
    ) -> tuple["Moving", "Actor | None"]:
        """The moving person to film, and the actor that it comes from; None for a body alone."""
        from ico3d.avatar.avatar import TrainedAvatar
        from ico3d.avatar.baking.person_bundle import animation_of
        from ico3d.avatar.film import actor
        from ico3d.avatar.models import open_model
        from ico3d.avatar.poseable import poseable_of
        from ico3d.avatar.recorded import read_cuts
        from ico3d.body.model_folder import TrainedBody
        from ico3d.bundle.format import Bundle
        from ico3d.errors import SettingsError

        model = open_model(self.model, TrainedAvatar, TrainedBody, Bundle)
        if isinstance(model, TrainedBody):
            if sound is not None:
                raise SettingsError(
                    f"{self.model} is a body alone, which does not talk: no --audio."
                )
            model.to(device)
            cuts = read_cuts(self.model, model)
            return self._gesturing(poseable_of(model, None, cuts), None) or model, None
        if isinstance(model, TrainedAvatar):
            model.to(device)
            animation = animation_of(self.model, model)
            cuts = read_cuts(self.model, model.body)
            found = actor.avatar_actor(model, animation, self._opened_capture(), cuts)
        else:
            found = actor.bundle_actor(model)
        return self._gesturing(found.poseable, found) or self._acting(found, sound), found

    def _gesturing(self, person: "Poseable | None", actor: "Actor | None") -> "Moving | None":
        """The person making the gestures of --gestures; None without that option."""
        from ico3d.avatar.film.gesturing import gestures
        from ico3d.errors import SettingsError

        if not self.gestures:
            return None
        if person is None:
            raise SettingsError(
                f"{self.model} has no skeleton that could gesture: --gestures is for bodies of "
                "--method skinned."
            )
        return gestures(person, actor, self.gestures, self.seed)

    def _acting(self, actor: "Actor", sound: "Sound | None") -> "Moving":
        """The person saying the sound or, without sound, repeating the recorded motion."""
        from ico3d.avatar.film import gesturing, performance

        if sound is None:
            return performance.motion(actor, self.seconds, self.seed)
        if actor.poseable is None:
            return performance.speech(actor, sound, self.seed)
        return gesturing.speech(actor.poseable, actor, sound, self.text, self.seed)

    def _opened_capture(self) -> "Capture | None":
        from ico3d.capture.formats import open_capture

        return None if self.capture is None else open_capture(self.capture)

    def _cameras(self, person: "Moving", actor: "Actor | None", count: int) -> list["Camera"]:
        """The camera of each of `count` pictures."""
        from ico3d.avatar import camera_path
        from ico3d.avatar.moving import extent
        from ico3d.avatar.render_bundle import visitor_camera
        from ico3d.errors import SettingsError

        acted = PORTRAIT if self.audio else START if self.gestures and actor else ORBIT
        path = self.path or acted
        if path in (START, PORTRAIT):
            if actor is None:
                raise SettingsError(f"--path {path}: nobody said where visitors of a body stand.")
            info = actor.view if path == START else actor.portrait
            return [visitor_camera(info, *self._sides)] * count
        if path != ORBIT:
            keys = camera_path.read_key_cameras(Path(path), *self._sides)
            return camera_path.through(keys, count)
        points, capture = extent(person), self._opened_capture()
        if capture is None:
            ring = camera_path.ring_around(points)
        else:
            ring = camera_path.ring_of(capture.cameras, points)
        return camera_path.orbit(ring, points, count, *self._sides)
