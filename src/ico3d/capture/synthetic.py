"""Reads a synthetic capture (docs/captures/synthetic.md, "Synthetic captures")."""

from pathlib import Path

import numpy as np
from safetensors import SafetensorError, safe_open

from ico3d.capture.box import Box, cut_out
from ico3d.capture.capture import RecordedCapture, Sound, all_frames, last_eleventh
from ico3d.capture.decoding import DAMAGED, open_picture, unit
from ico3d.capture.multiview.description import MOST_FRAMES, number
from ico3d.capture.sound import check_claim
from ico3d.common.camera import Camera
from ico3d.common.files import check_regular, json_of
from ico3d.common.people.stated import NOBODY
from ico3d.common.sound import WAV_ERRORS, open_claim, open_wav
from ico3d.common.unpacking.heads import check_head
from ico3d.errors import CaptureError

FORMAT, VERSION = "ico3d-synthetic", 2
READABLE = (1, 2)
"""Versions that can be read; version 1 has no field for what is shown and is always a head."""
MOST_POINTS = 1_000_000
"""Points of the surface in a frame; recordings have 6,000."""
LARGEST = 1 << 29
"""Bytes of the file of frames: an hour of a body's points takes as much."""
NEEDED = ("format", "version", "fps", "num_frames", "blendshape_names", "cameras", "sources")


class SyntheticCapture(RecordedCapture):
    """A synthetic person recorded by `ico3d capture synthetic`, with exact ground truth."""

    kind = "synthetic"

    def __init__(self, path: Path):
        """Opens a capture; pictures and sound are read when asked for.

        Raises:
            CaptureError: If `capture.json` or `frames.safetensors` is missing or damaged.
        """
        self.path = path
        about = _read_json(path / "capture.json")
        self._about = about
        where = str(path / "capture.json")
        self.fps = number(about, "fps", where, 1e-3, 1e5)
        self.num_frames = int(number(about, "num_frames", where, 1, MOST_FRAMES))
        self.blendshape_names = tuple(about["blendshape_names"])
        self.cameras = tuple(_camera(c, path) for c in about["cameras"])
        self.shows = "body" if about.get("shows", "head") == "body" else "head"
        self._frames = self._read_frames()  # has a row for each frame that is claimed
        self.split = (
            all_frames(self.num_frames, self.cameras)
            if self.shows == "body"
            else last_eleventh(self.num_frames)
        )

    @property
    def phonemes(self) -> tuple[tuple[float, str], ...]:
        """Pairs of start in seconds and IPA symbol of what is said; an empty symbol is a pause."""
        try:
            return tuple((float(t), str(s)) for t, s in self._about.get("phonemes", ()))
        except (TypeError, ValueError, OverflowError) as error:
            where = self.path / "capture.json"
            raise CaptureError(f"{where}: its phonemes are damaged: record again.") from error

    @property
    def provenance(self) -> dict:
        """Sources of geometry and voice, with their licences."""
        return {
            "kind": self.kind,
            "sources": list(self._about["sources"]),
            "likeness": NOBODY,
            "consent": "not needed: no such person exists",
            "licence": str(self._about.get("licence", "")),
        }

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether the camera recorded this frame."""
        return bool(self._frames["views"][self._index(frame), camera])

    def has_mask(self, camera: int, frame: int) -> bool:
        """Every picture has a mask."""
        return self.has_image(camera, frame)

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The picture, uint8, or None if the camera did not record this frame."""
        return self._picture("images", camera, frame, "RGB", box)

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """(H, W) exact coverage of the person, uint8, or None without a picture."""
        return self._picture("masks", camera, frame, "L", box)

    def background(self, camera: int) -> np.ndarray | None:
        """(H, W, 3) clean plate: the backdrop."""
        name = self.cameras[camera].name
        file = self.path / "backgrounds" / f"{name}.png"
        what = f"the background of camera {name}"
        return unit(_read_png(file, self.cameras[camera], "RGB", what))

    def audio(self) -> Sound | None:
        """The sound, 16 kHz mono.

        Raises:
            CaptureError: If the sound is damaged.
        """
        file = self.path / "audio.wav"
        try:
            check_regular(file)
            with file.open("rb") as content, open_wav(content) as sound:
                if sound.getnchannels() != 1 or sound.getsampwidth() != 2:
                    raise CaptureError(f"the sound {file} is not mono with 16 bits.")
                check_claim(file, open_claim(sound, file.stat().st_size))
                rate, data = sound.getframerate(), sound.readframes(sound.getnframes())
            pcm = np.frombuffer(data, "<i2")  # ValueError for half a sample
        except (OSError, ValueError, *WAV_ERRORS) as error:
            raise CaptureError(f"the sound {file} is missing or damaged: record again.") from error
        return Sound(pcm.astype(np.float32) / 32767, rate)

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """(4, 4) float64 exact head pose."""
        return self._frames["world_from_head"][self._index(frame)]

    def eyes(self, frame: int) -> np.ndarray | None:
        """(7,) values in the order of `EYE_NAMES`."""
        return self._frames["eyes"][self._index(frame)]

    def blendshapes(self, frame: int) -> np.ndarray | None:
        """(K,) weights from which the face was made."""
        return self._frames["blendshapes"][self._index(frame)]

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) exact landmarks in pixels, even for views without a picture."""
        seen = self.cameras[camera].moved(self._frames["world_from_head"][self._index(frame)])
        return seen.project(self._frames["landmarks"][frame])[0]

    def landmarks_3d(self, frame: int) -> np.ndarray | None:
        """(68, 3) landmarks in canonical head space, metres."""
        return self._frames["landmarks"][self._index(frame)]

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points of a neutral head in head space; None in recordings of bodies."""
        return self._frames["points"] if self.shows == "head" else None

    def world_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) surface points of a body in a frame, in the world; None for heads."""
        return self._frames["points"][self._index(frame)] if self.shows == "body" else None

    def _index(self, frame: int) -> int:
        if not 0 <= frame < self.num_frames:
            raise CaptureError(f"{self.path} has frames 0 to {self.num_frames - 1}, not {frame}.")
        return frame

    def _picture(
        self, folder: str, camera: int, frame: int, mode: str, box: Box | None
    ) -> np.ndarray | None:
        if not self.has_image(camera, frame):
            return None
        seen = self.cameras[camera]
        file = self.path / folder / seen.name / f"{frame:06d}.png"
        what = f"frame {frame} of camera {seen.name}"
        return cut_out(_read_png(file, seen, mode, what), box)

    def _read_frames(self) -> dict[str, np.ndarray]:
        file = self.path / "frames.safetensors"
        try:
            check_regular(file)
            if file.stat().st_size > LARGEST:
                raise ValueError("it is larger than a recording's")
            check_head(file)
            with safe_open(file, "numpy") as content:
                names = list(content.keys())
                arrays = {name: content.get_tensor(name) for name in names}
        except (OSError, SafetensorError, ValueError, TypeError, AttributeError) as error:
            raise CaptureError(f"{file} is missing or damaged: record again.") from error
        frames, shapes = self.num_frames, len(self._about["blendshape_names"])
        expected = {
            "world_from_head": (frames, 4, 4),
            "eyes": (frames, 7),
            "blendshapes": (frames, shapes),
            "landmarks": (frames, 68, 3),
            "views": (frames, len(self.cameras)),
            "points": (frames, None, 3) if self.shows == "body" else (None, 3),
        }
        for name, shape in expected.items():
            _check_array(file, name, arrays.get(name), shape)
        if arrays["points"].shape[-2] > MOST_POINTS:
            raise CaptureError(f"{file}: more than {MOST_POINTS} points: record again.")
        return arrays


def _check_array(
    file: Path, name: str, array: np.ndarray | None, shape: tuple[int | None, ...]
) -> None:
    if array is None:
        raise CaptureError(f"{file} lacks '{name}': record again.")
    fits = len(array.shape) == len(shape) and all(
        wanted in (None, got) for wanted, got in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise CaptureError(f"{file}: '{name}' must have shape {shape}, but has {array.shape}.")
    kinds = (np.bool_, np.uint8) if name == "views" else (np.float32, np.float64)
    if array.dtype not in kinds:
        raise CaptureError(f"{file}: '{name}' must not be {array.dtype}: record again.")
    finite = np.isfinite(array)
    if not finite.all():
        bad = int(np.argmin(finite.all(axis=tuple(range(1, finite.ndim)))))
        raise CaptureError(f"{file}: row {bad} of '{name}' is not finite: record again.")


def _read_json(file: Path) -> dict:
    try:
        about = json_of(file)
    except (OSError, ValueError) as error:
        raise CaptureError(f"{file} is missing or damaged: record again.") from error
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise CaptureError(f"{file} does not describe a synthetic capture ('{FORMAT}').")
    if about.get("version") not in READABLE:
        known = " and ".join(map(str, READABLE))
        raise CaptureError(f"{file} has version {about.get('version')}; this reads {known}.")
    missing = [name for name in NEEDED if name not in about]
    if missing:
        raise CaptureError(f"{file} lacks {', '.join(missing)}: record again.")
    for name in ("blendshape_names", "cameras", "sources"):
        if not isinstance(about[name], list):
            raise CaptureError(f"{file}: {name} must be a list: record again.")
    if not about["cameras"]:
        raise CaptureError(f"{file} lists no cameras: record again.")
    return about


def _camera(entry: dict, path: Path) -> Camera:
    try:
        return Camera(
            int(entry["width"]),
            int(entry["height"]),
            np.array(entry["intrinsics"], float),
            np.array(entry["world_to_camera"], float),
            str(entry["name"]),
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise CaptureError(f"{path / 'capture.json'}: a camera is damaged: {error}.") from error


def _read_png(file: Path, camera: Camera, mode: str, what: str) -> np.ndarray:
    """uint8 pixels of a file that must have the size of its camera."""
    try:
        with open_picture(file, str(file)) as image:
            pixels = np.asarray(image if image.mode == mode else image.convert(mode))
    except DAMAGED as error:
        raise CaptureError(f"{file} ({what}) is missing or damaged: record again.") from error
    if pixels.shape[:2] != (camera.height, camera.width):
        raise CaptureError(
            f"{file} ({what}) is {pixels.shape[1]}×{pixels.shape[0]}, "
            f"but its camera takes {camera.width}×{camera.height}."
        )
    return pixels
