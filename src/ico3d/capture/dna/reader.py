"""Reads a recording of the DNA-Rendering data set: `docs/captures-dna.md`."""

import logging
from functools import cached_property
from pathlib import Path

import numpy as np

from ico3d.capture.capture import Capture, all_frames
from ico3d.capture.decoding import decoded, unit
from ico3d.capture.dna.annotations import BodyFits, SmplX, gender_of, person, row
from ico3d.capture.dna.calibration import GROUPS, Device, read_devices
from ico3d.capture.dna.examine import examine_files
from ico3d.capture.dna.files import find_files
from ico3d.capture.dna.kinect import Kinect
from ico3d.capture.dna.smc import SmcFile
from ico3d.capture.extras import opencv
from ico3d.capture.finding import Finding
from ico3d.capture.poses import nearest_axis, turn_upright, turned, up_of_cameras
from ico3d.common.camera import Camera
from ico3d.errors import CaptureError

log = logging.getLogger(__name__)
FPS = 15.0
MOST_FRAMES = 100_000


class DnaRendering(Capture):
    """One performance of DNA-Rendering: 60 cameras around a whole person.

    Pictures and masks come straightened, colours corrected. The world of the files is turned by
    right angles so that +y is up; what the files say in their own world, such as SMPL-X, states
    how to get to the capture's.
    """

    kind = "dna-rendering"
    fps = FPS

    def __init__(self, path: Path):
        """Opens the files and reads the calibration; pictures are read when asked for.

        Args:
            path: The main file, or a folder that holds one recording.

        Raises:
            CaptureError: If a file is missing or damaged, or the folder holds several recordings.
            MissingExtraError: If h5py or OpenCV is not installed.
        """
        files = find_files(path)
        self.path = files.main
        self._main, self._annotations = SmcFile(files.main), SmcFile(files.annotations)
        self._kinect_path = files.kinect
        self._devices, lost = read_devices(self._main, self._annotations)
        if lost:
            log.warning("%s: cameras without calibration left out: %s", path, ", ".join(lost))
        self.num_frames = self._count_frames()
        places = [device.camera_to_world for device in self._devices]
        self._upright = turn_upright(nearest_axis(up_of_cameras(places)))
        self.cameras = tuple(self._camera(device) for device in self._devices)
        self.split = all_frames(self.num_frames, self.cameras)

    def image(self, camera: int, frame: int) -> np.ndarray | None:
        """The straightened picture with corrected colours, or None where there is none."""
        device = self._devices[camera]
        picture = self._decoded(self._main, device, f"{device.pictures}/{self._index(frame)}")
        if picture is None:
            return None
        corrected = opencv("correcting colours").LUT(picture, device.colours[None])  # (H, W, 3)
        return unit(device.lens.straightened(corrected))

    def mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The straightened mask; None in parts of the data set that have none."""
        device = self._devices[camera]
        inside = f"Mask/{device.number}/mask/{self._index(frame)}"
        picture = self._decoded(self._annotations, device, inside)
        return None if picture is None else unit(device.lens.straightened(person(picture)))

    def keypoints_2d(self, camera: int, frame: int) -> np.ndarray | None:
        """(J, 3) pixels of the straightened picture, and confidence; None where there are none."""
        device = self._devices[camera]
        table = self._annotations.numbers(f"Keypoints_2D/{device.name}", (None, None, 3))
        found = row(table, self._index(frame))
        if found is None:
            return None
        pixels = device.lens.straightened_points(found[:, :2] + 0.5)  # (J, 2)
        return np.concatenate([pixels, found[:, 2:]], 1)

    def keypoints_3d(self, frame: int) -> np.ndarray | None:
        """(J, 3) metres in the capture's world, or None where there are none."""
        table = self._annotations.numbers("Keypoints_3D/keypoints3d", (None, None, 3))
        found = row(table, self._index(frame))
        return None if found is None else found @ self._upright.T

    def smplx(self, frame: int) -> SmplX | None:
        """The body model's parameters of a frame, or None where there are none."""
        return None if self._fits is None else self._fits.at(self._index(frame))

    @cached_property
    def kinect(self) -> Kinect | None:
        """The depth cameras, or None where their file is not there."""
        if self._kinect_path is None:
            return None
        return Kinect(SmcFile(self._kinect_path), self._upright)

    @property
    def provenance(self) -> dict:
        """The data set, and the licence that whoever fetched it has signed."""
        return {
            "kind": self.kind,
            "sources": [f"DNA-Rendering (ICCV 2023), recording {self.path.stem}"],
            "consent": "given to the makers of DNA-Rendering",
            "licence": "DNA-Rendering licence agreement",
        }

    def inspect(self) -> list[Finding]:
        """Missing and damaged pictures and annotations."""
        return examine_files(
            self._main,
            self._annotations,
            self._devices,
            self.num_frames,
            [] if self._fits is None else self._fits.faults,
        )

    @cached_property
    def _fits(self) -> BodyFits | None:
        if not self._annotations.keys("SMPLx"):
            return None
        gender = gender_of(self._main.attribute("", "gender"))
        turn = turned(self._upright, np.eye(4))
        return BodyFits(self._annotations, self.num_frames, gender, turn)

    def _camera(self, device: Device) -> Camera:
        """The pinhole camera of the straightened pictures."""
        inverse = np.linalg.inv(turned(self._upright, device.camera_to_world))
        lens = device.lens
        return Camera(lens.width, lens.height, lens.straight_intrinsics, inverse, device.name)

    def _count_frames(self) -> int:
        """Frames the file announces; without an announcement, those of the first camera."""
        announced = [self._main.attribute(group, "num_frame") for group in GROUPS]
        try:
            counts = [
                int(np.asarray(value).reshape(())) for value in announced if value is not None
            ]
        except (TypeError, ValueError) as error:
            raise CaptureError(f"{self.path}: num_frame is damaged: fetch it again.") from error
        count = max(counts) if counts else len(self._main.keys(self._devices[0].pictures))
        if not 1 <= count <= MOST_FRAMES:
            raise CaptureError(f"{self.path} announces {count} frames: fetch it again.")
        return count

    def _index(self, frame: int) -> int:
        if not 0 <= frame < self.num_frames:
            raise CaptureError(f"{self.path} has frames 0 to {self.num_frames - 1}, not {frame}.")
        return frame

    def _decoded(self, file: SmcFile, device: Device, inside: str) -> np.ndarray | None:
        """A picture of a camera, uint8 RGB (H, W, 3)."""
        held = file.encoded(inside)
        if held is None:
            return None
        frame = inside.rpartition("/")[2]
        what = f"{file.path}: camera {device.name}, frame {frame} ({inside})"
        picture = decoded(held, what)[..., :3]
        height, width = picture.shape[:2]
        if (width, height) != (device.lens.width, device.lens.height):
            raise CaptureError(
                f"{what} has {width}x{height} pixels; the first of its kind "
                f"{device.lens.width}x{device.lens.height}."
            )
        return picture
