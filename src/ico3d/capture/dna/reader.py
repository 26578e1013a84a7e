"""Reads a recording of the DNA-Rendering data set: `docs/captures/dna.md`."""

import logging
from functools import cached_property
from pathlib import Path

import numpy as np

from ico3d.capture.box import Box, cut_out
from ico3d.capture.capture import all_frames
from ico3d.capture.dna.annotations import BodyFits, gender_of, person, row
from ico3d.capture.dna.calibration import GROUPS, read_devices
from ico3d.capture.dna.examine import examine_files
from ico3d.capture.dna.files import find_files
from ico3d.capture.dna.kinect import Kinect
from ico3d.capture.extras import opencv
from ico3d.capture.finding import Finding
from ico3d.capture.poses import turned
from ico3d.capture.smc.file import SmcFile
from ico3d.capture.smc.reader import SmcCapture, count_frames
from ico3d.capture.smplx import SmplX

log = logging.getLogger(__name__)
FPS = 15.0
WHOLE_BODY = 133
"""Number of COCO-WholeBody keypoints: 17 of the body, 6 of feet, 68 of the face, 42 of hands."""
FACE = np.arange(23, 91)


class DnaRendering(SmcCapture):
    """One performance of DNA-Rendering: 60 cameras around a whole person.

    Pictures and masks are undistorted, colours corrected. Data in the world of the files, such as
    SMPL-X, come with the transform to the capture's world.
    """

    kind = "dna-rendering"
    shows = "body"
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
        self._main, self._annotations = SmcFile(files.main), SmcFile(files.annotations)
        self._kinect_path = files.kinect
        self._devices, lost = read_devices(self._main, self._annotations)
        if lost:
            log.warning("%s: cameras without calibration left out: %s", path, ", ".join(lost))
        count = count_frames(self._main, GROUPS, [d.pictures for d in self._devices])
        super().__init__(files.main, self._devices, count)
        self.split = all_frames(self.num_frames, self.cameras)

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether the file holds the picture."""
        return self._main.lists(self._picture_path(camera, frame))

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether the annotations hold a mask."""
        return self._annotations.lists(self._mask_path(camera, frame))

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The undistorted picture with corrected colours, uint8, or None."""
        device = self._devices[camera]
        picture = self.decoded(self._main, device, self._picture_path(camera, frame))
        if picture is None:
            return None
        cv2 = opencv("correcting colours")
        if device.lens.bends:  # pixels are mixed after their colours were corrected
            return device.lens.straightened(cv2.LUT(picture, device.colours[None]), box)
        return cv2.LUT(np.ascontiguousarray(cut_out(picture, box)), device.colours[None])

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The undistorted mask, uint8; None in parts of the data set without masks."""
        device = self._devices[camera]
        picture = self.decoded(self._annotations, device, self._mask_path(camera, frame))
        if picture is None:
            return None
        if device.lens.bends:
            return device.lens.straightened(person(picture), box)
        return person(cut_out(picture, box))

    def _picture_path(self, camera: int, frame: int) -> str:
        """Where a picture lies within the main file."""
        return f"{self._devices[camera].pictures}/{self.index(frame)}"

    def _mask_path(self, camera: int, frame: int) -> str:
        """Where a mask lies within the annotations."""
        return f"Mask/{self._devices[camera].number}/mask/{self.index(frame)}"

    def keypoints_2d(self, camera: int, frame: int) -> np.ndarray | None:
        """(J, 3) keypoints: pixels of the undistorted picture, and confidence; None if missing."""
        device = self._devices[camera]
        table = self._annotations.numbers(f"Keypoints_2D/{device.name}", (None, None, 3))
        found = row(table, self.index(frame))
        if found is None:
            return None
        pixels = device.lens.straightened_points(found[:, :2] + 0.5)  # (J, 2)
        return np.concatenate([pixels, found[:, 2:]], 1)

    def keypoints_3d(self, frame: int) -> np.ndarray | None:
        """(J, 3) keypoints in the capture's world, metres, NaN where not found; None if missing."""
        found = row(self._all_keypoints, self.index(frame))
        return None if found is None else found @ self.upright.T

    def whole_body_points(self, frame: int) -> np.ndarray | None:
        """(133, 3) keypoints in the world, metres; NaN where triangulation failed."""
        found = self.keypoints_3d(frame)
        if found is None or len(found) != WHOLE_BODY:
            return None
        lost = (found == 0).all(-1, keepdims=True)
        return np.where(lost, np.nan, found)

    def face_points(self) -> np.ndarray | None:
        """(F, 68, 3) face keypoints of COCO-WholeBody, whose order is that of Multi-PIE, metres."""
        table = self._all_keypoints
        if table is None or table.shape[1] != WHOLE_BODY:
            return None
        points = np.full((self.num_frames, len(FACE), 3), np.nan)
        known = table[: self.num_frames, FACE] @ self.upright.T
        points[: len(known)] = known
        points[(points == 0).all(-1)] = np.nan  # what triangulation could not find
        return points

    @cached_property
    def _all_keypoints(self) -> np.ndarray | None:
        """(T, J, 3) metres in the world of the files; read once, as it is asked for each frame."""
        inside = "Keypoints_3D/keypoints3d"
        return self._annotations.numbers(inside, (None, None, 3), holes=True)

    def smplx(self, frame: int) -> SmplX | None:
        """SMPL-X parameters of a frame, or None."""
        return None if self._fits is None else self._fits.at(self.index(frame))

    @cached_property
    def kinect(self) -> Kinect | None:
        """The depth cameras; None if their file is missing."""
        if self._kinect_path is None:
            return None
        return Kinect(SmcFile(self._kinect_path), self.upright)

    @property
    def provenance(self) -> dict:
        """The data set, and the licence that its users have signed."""
        return {
            "kind": self.kind,
            "sources": [f"DNA-Rendering (ICCV 2023), recording {self.path.stem}"],
            "likeness": f"the person of DNA-Rendering {self.path.stem}",
            "consent": "given to the makers of DNA-Rendering",
            "licence": "DNA-Rendering licence agreement",
        }

    def inspect(self) -> list[Finding]:
        """Missing or damaged pictures and annotations."""
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
        turn = turned(self.upright, np.eye(4))
        return BodyFits(self._annotations, self.num_frames, gender, turn)
