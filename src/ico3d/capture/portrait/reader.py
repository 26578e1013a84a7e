"""Reads the talking-portrait layout, written by ico3d or by other programs."""

import io
import os
import re
from collections import Counter
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from ico3d.capture.box import Box, cut_out
from ico3d.capture.capture import EYE_NAMES, RecordedCapture, Sound, Split
from ico3d.capture.decoding import DAMAGED, open_picture, to_bytes, unit
from ico3d.capture.face.expressions import AU_COLUMNS, eyes_of_action_units, eyes_of_blendshapes
from ico3d.capture.multiview.description import MOST_FRAMES, number, read_json
from ico3d.capture.portrait.files import DETAILS, OPENGL_FROM_OPENCV, load_landmarks, stated_in
from ico3d.capture.portrait.parsing import BACKGROUND, FACE, HAIR, MOUTH, is_class
from ico3d.capture.reading.arrays import read_numbers
from ico3d.capture.sound import read_sound_file
from ico3d.capture.surface.first_points import unknown_person
from ico3d.capture.vetting.claims import check_claimed
from ico3d.common.camera import Camera
from ico3d.common.files import read_small
from ico3d.errors import CaptureError

_NUMBER = re.compile("[0-9]{1,9}")
FPS = 25.0
Result = TypeVar("Result")


class TalkingPortrait(RecordedCapture):
    """A talking-portrait folder: one steady camera, one head.

    The world is the camera's frame in OpenGL axes (y up, camera looks along -z), so a person who
    faces the camera faces +z. Frame numbers are those of the files. A frame without a face has no
    picture and no pose, and is in neither part of the split.
    """

    kind = "portrait"
    tells_head = True

    def __init__(self, path: Path):
        """Opens the folder and checks that its files agree; pictures are read when asked for.

        Raises:
            CaptureError: If a file is missing or damaged; the sentence names file and frame.
        """
        self.path = path
        self._details = read_json(path / DETAILS) if os.path.isfile(path / DETAILS) else {}
        parts = {name: read_json(path / f"transforms_{name}.json") for name in ("train", "val")}
        ids = {name: _ids(path, name, part) for name, part in parts.items()}
        self.split = Split(ids["train"], ids["val"])
        self._poses = {
            int(frame["img_id"]): _pose(path, name, frame)
            for name, part in parts.items()
            for frame in part["frames"]
        }
        listed = max(self._poses) + 1
        pictures = _numbers(path / "ori_imgs", ".jpg")
        known = max(listed, max(pictures, default=-1) + 1)
        counted = {"fps": FPS, "num_frames": known} | self._details
        where = str(path / DETAILS)
        self._stated = stated_in(self._details, where)
        self.fps = number(counted, "fps", where, 1e-3, 1e3)
        self.num_frames = int(number(counted, "num_frames", where, listed, MOST_FRAMES))
        check_claimed(self.num_frames, [max(len(pictures), len(self._poses))], str(path))
        self.cameras = (self._camera(parts["train"]),)
        self.blendshape_names = self._names()
        _check_ids(path, sorted(self._poses))
        self._check_rows()

    def has_image(self, camera: int, frame: int) -> bool:
        """Whether a face was found in the frame.

        Raises:
            CaptureError: If the frame's picture is missing.
        """
        return frame in self._poses and os.path.isfile(self._recorded(frame))

    def has_mask(self, camera: int, frame: int) -> bool:
        """Whether the frame has a soft mask or was parsed."""
        files = (self.path / "alpha" / f"{frame}.png", self._parsing_file(frame))
        return frame in self._poses and any(os.path.isfile(file) for file in files)

    def image_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The person on the clean plate if the folder has one, else the recorded picture; uint8."""
        if frame not in self._poses:
            return None
        return cut_out(_picture(self._recorded(frame)), box)

    def mask_bytes(self, camera: int, frame: int, box: Box | None = None) -> np.ndarray | None:
        """The soft mask that ico3d writes, else all pixels not parsed as background; uint8."""
        soft = self.path / "alpha" / f"{frame}.png"
        if frame in self._poses and os.path.isfile(soft):
            return cut_out(_picture(soft), box)
        parsing = self._parsing(frame)
        if parsing is None:
            return None
        return to_bytes(1.0 - is_class(cut_out(parsing, box), BACKGROUND))

    def head_mask(self, camera: int, frame: int) -> np.ndarray | None:
        """The mask of face, hair and mouth."""
        parsing = self._parsing(frame)
        return None if parsing is None else is_class(parsing, FACE, HAIR, MOUTH)

    def background(self, camera: int) -> np.ndarray | None:
        """The clean plate `bc.jpg`."""
        plate = self.path / "bc.jpg"
        return unit(_picture(plate)) if os.path.isfile(plate) else None

    def torso(self, camera: int, frame: int) -> np.ndarray | None:
        """(H, W, 4) neck and clothes of `torso_imgs`, with their opacity.

        Raises:
            CaptureError: If the file is damaged or has no opacity.
        """
        file = self.path / "torso_imgs" / f"{frame}.png"
        if frame not in self._poses or not os.path.isfile(file):
            return None
        with _reading(file, lambda: open_picture(file, str(file))) as picture:
            if picture.mode != "RGBA":
                raise CaptureError(f"{file} has no opacity: it must be RGBA.")
            return _reading(file, lambda: np.asarray(picture, np.float32) / 255)

    def audio(self) -> Sound | None:
        """The sound of `aud.wav` at 16 kHz."""
        return read_sound_file(self.path / "aud.wav")

    def world_from_head(self, frame: int) -> np.ndarray | None:
        """The head pose (4, 4) of a frame; None without a face."""
        return self._poses.get(frame)

    def eyes(self, frame: int) -> np.ndarray | None:
        """(7,) eye values from blendshapes, else from action units, smoothed over time."""
        return None if self._eyes is None or frame >= len(self._eyes) else self._eyes[frame]

    def blendshapes(self, frame: int) -> np.ndarray | None:
        """(52,) weights from `bs.npy`."""
        return None if self._blendshapes is None else self._blendshapes[frame]

    def landmarks(self, camera: int, frame: int) -> np.ndarray | None:
        """(68, 2) pixels from the `.lms` file of the frame.

        Raises:
            CaptureError: If the file is damaged.
        """
        path = self.path / "ori_imgs" / f"{frame}.lms"
        if frame not in self._poses or not os.path.isfile(path):
            return None
        points = _reading(path, lambda: load_landmarks(path))
        if points.shape != (68, 2) or not np.isfinite(points).all():
            raise CaptureError(f"{path}: expected 68 finite landmarks; delete or redo the file.")
        return points

    def head_points(self, frame: int = 0) -> np.ndarray | None:
        """(P, 3) tracked face with a guessed body around it, or a guess of both."""
        path = self.path / "points.npy"
        if not os.path.isfile(path):
            return unknown_person()
        points = read_numbers(path)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise CaptureError(f"{path} must hold (P, 3) finite numbers.")
        return points

    @property
    def provenance(self) -> dict:
        """Likeness, consent, licence and sources, as far as the folder states them."""
        unknown = super().provenance | {"sources": [self.path.name]}
        return unknown | self._stated

    @property
    def details(self) -> dict:
        """Contents of `ico3d.json`, which ico3d's tracker writes; empty for other folders."""
        return self._details

    @cached_property
    def _blendshapes(self) -> np.ndarray | None:
        """(N, 52) float32 of `bs.npy`."""
        path = self.path / "bs.npy"
        if not os.path.isfile(path):
            return None
        return read_numbers(path).astype(np.float32)

    @cached_property
    def _action_units(self) -> dict[str, np.ndarray] | None:
        """The columns of `au.csv` that are used; OpenFace puts a space before their names."""
        path = self.path / "au.csv"
        if not os.path.isfile(path):
            return None
        # OpenFace's tables have megabytes, and as one text up to four times as many
        lines = io.TextIOWrapper(io.BytesIO(_reading(path, lambda: read_small(path))), "utf-8")
        names = [name.strip() for name in _reading(path, lines.readline).split(",")]
        missing = [name for name in AU_COLUMNS if name not in names]
        if missing:
            raise CaptureError(f"{path}: there is no column {missing[0]}; OpenFace writes it.")
        wanted = [names.index(name) for name in AU_COLUMNS]
        table = _reading(
            path,
            lambda: np.loadtxt(
                lines, delimiter=",", usecols=wanted, ndmin=2, max_rows=self.num_frames + 1
            ),
        )
        return dict(zip(AU_COLUMNS, table.T, strict=True))

    @cached_property
    def _eyes(self) -> np.ndarray | None:
        """(N, 7) smoothed."""
        names = self.blendshape_names
        if self._blendshapes is not None and names and set(EYE_NAMES) <= set(names):
            return eyes_of_blendshapes(self._blendshapes, names)
        return None if self._action_units is None else eyes_of_action_units(self._action_units)

    def _names(self) -> tuple[str, ...] | None:
        """Names of the columns of `bs.npy`: as stated, else MediaPipe's, which these tools use."""
        if self._blendshapes is None:
            return None
        from ico3d.capture.face.expressions import BLENDSHAPES

        stated = self._details.get("blendshape_names", [])
        if not isinstance(stated, list) or not all(isinstance(name, str) for name in stated):
            raise CaptureError(f"{self.path / DETAILS}: blendshape_names must be a list of names.")
        names = tuple(stated) or BLENDSHAPES
        if self._blendshapes.ndim != 2 or self._blendshapes.shape[1] != len(names):
            raise CaptureError(
                f"{self.path / 'bs.npy'}: expected {len(names)} columns, "
                f"found shape {self._blendshapes.shape}."
            )
        return names

    def _camera(self, transforms: dict) -> Camera:
        """The steady camera; it is the world."""
        first = self._recorded(min(self._poses))
        with _reading(first, lambda: open_picture(first, str(first))) as picture:
            width, height = picture.size
        file = self.path / "transforms_train.json"
        values = [transforms.get(k, d) for k, d in _lens_defaults(width, height)]
        # Whole numbers of JSON may be too large for a float; NaN is no number between these either.
        if not all(isinstance(v, int | float) and abs(v) < 1e6 for v in values):
            raise CaptureError(f"{file}: focal_len, cx and cy must be numbers in pixels.")
        focal, x, y = values
        if abs(x - width / 2) > width / 4 or abs(y - height / 2) > height / 4:
            raise CaptureError(
                f"{file}: principal point ({x}, {y}) does not fit the {width}x{height} pictures; "
                "were they scaled after tracking?"
            )
        lens = np.array([[focal, 0, x], [0, focal, y], [0, 0, 1.0]])
        return Camera(width, height, lens, OPENGL_FROM_OPENCV)

    def _parsing(self, frame: int) -> np.ndarray | None:
        """The parsing picture of a frame with a face, uint8 RGB."""
        path = self._parsing_file(frame)
        if frame not in self._poses or not os.path.isfile(path):
            return None
        return _picture(path, "RGB")

    def _parsing_file(self, frame: int) -> Path:
        """Where the parsing picture of a frame lies, if it was parsed."""
        return self.path / "parsing" / f"{frame}.png"

    def _recorded(self, frame: int) -> Path:
        """The picture of a frame: on the clean plate if the folder has it, else as recorded.

        Raises:
            CaptureError: If there is neither.
        """
        for folder in ("gt_imgs", "ori_imgs"):
            if os.path.isfile(file := self.path / folder / f"{frame}.jpg"):
                return file
        raise CaptureError(
            f"{self.path}: frame {frame} is listed in the transforms, but ori_imgs/{frame}.jpg is "
            "missing."
        )

    def _check_rows(self) -> None:
        """Rows of tables must belong to frame numbers, not to a count of frames with a face."""
        tables = {"bs.npy": self._blendshapes}
        units = self._action_units
        if units is not None:
            tables["au.csv"] = np.stack(list(units.values()), 1)
        for name, table in tables.items():
            if table is None:
                continue
            if len(table) != self.num_frames:
                raise CaptureError(
                    f"{self.path / name} has {len(table)} rows for {self.num_frames} frames: "
                    "row i must belong to frame i; extract it again from all frames."
                )
            bad = np.flatnonzero(~np.isfinite(table).all(1))
            if len(bad):
                raise CaptureError(f"{self.path / name}: row {bad[0]} holds NaN or infinity.")


def _lens_defaults(width: int, height: int) -> list[tuple[str, float | None]]:
    """Keys of the lens in the transforms, and what holds where one is absent."""
    return [("focal_len", None), ("cx", width / 2), ("cy", height / 2)]


def _check_ids(path: Path, ids: list[int]) -> None:
    """Frame ids, pictures and landmark files must speak of the same frames."""
    pictures = _numbers(path / "ori_imgs", ".jpg") | _numbers(path / "gt_imgs", ".jpg")
    absent = [i for i in ids if i not in pictures]
    if absent:
        raise CaptureError(
            f"{path}: frame {absent[0]} is listed in the transforms, "
            f"but ori_imgs/{absent[0]}.jpg is missing."
        )
    marked = _numbers(path / "ori_imgs", ".lms")
    bare = [i for i in ids if marked and i not in marked]
    if not bare:
        return
    if len(marked) == len(ids):
        raise CaptureError(
            f"{path}: img_id in the transforms counts only frames with landmarks, so it is off "
            f"from frame {bare[0]} on (ori_imgs/{bare[0]}.lms is missing); img_id must be the "
            "number of the picture."
        )
    raise CaptureError(
        f"{path}: frame {bare[0]} has a pose, but ori_imgs/{bare[0]}.lms is missing."
    )


def _ids(path: Path, name: str, transforms: dict) -> tuple[int, ...]:
    """Frame numbers of one transforms file, ascending."""
    file = path / f"transforms_{name}.json"
    frames = transforms.get("frames")
    if not isinstance(frames, list) or (name == "train" and not frames):
        raise CaptureError(f"{file} lists no frames.")
    given = [frame.get("img_id") if isinstance(frame, dict) else None for frame in frames]
    ids = [i for i in given if type(i) is int and 0 <= i < MOST_FRAMES]  # no True
    if len(ids) < len(given):
        most = MOST_FRAMES - 1
        raise CaptureError(f"{file}: every frame needs a whole img_id from 0 to {most}.")
    doubled = sorted(i for i, count in Counter(ids).items() if count > 1)
    if doubled:
        raise CaptureError(f"{file}: frame {doubled[0]} is listed twice.")
    off = next((f for f in frames if f.get("aud_id", f["img_id"]) != f["img_id"]), None)
    if off is not None:
        raise CaptureError(
            f"{file}: frame {off['img_id']} has aud_id {off['aud_id']}; picture and sound must be "
            "of one moment."
        )
    return tuple(sorted(ids))


def _pose(path: Path, name: str, frame: dict) -> np.ndarray:
    """W (4, 4) of one frame: OpenGL camera axes from head, the inverse of `transform_matrix`."""
    where = f"{path / f'transforms_{name}.json'}: frame {frame['img_id']}"
    try:
        matrix = np.asarray(frame["transform_matrix"], np.float64)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise CaptureError(f"{where} has no 4x4 transform_matrix.") from error
    if matrix.shape != (4, 4):
        raise CaptureError(f"{where} has no 4x4 transform_matrix.")
    if not np.isfinite(matrix).all():
        raise CaptureError(f"{where}: the pose holds NaN or infinity; track the frame again.")
    rotation = matrix[:3, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0:
        raise CaptureError(f"{where}: the pose is no rotation and translation.")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, -rotation.T @ matrix[:3, 3]
    return pose


def _picture(path: Path, *modes: str) -> np.ndarray:
    """A picture as uint8, in one of some modes of Pillow: as it is, or else in the first."""
    wanted = modes or ("RGB", "L")
    with _reading(path, lambda: open_picture(path, str(path))) as opened:
        kept = opened.mode in wanted
        return _reading(path, lambda: np.asarray(opened if kept else opened.convert(wanted[0])))


def _reading(path: Path, read: Callable[[], Result]) -> Result:
    """Reads a file; what goes wrong becomes one sentence."""
    try:
        return read()
    except (*DAMAGED, RuntimeError) as error:
        raise CaptureError(f"{path} cannot be read: {error}.") from error


def _numbers(folder: Path, suffix: str) -> set[int]:
    """The numbers that are file names in a folder."""
    if not os.path.isdir(folder):
        return set()
    return {
        int(p.stem) for p in folder.iterdir() if p.suffix == suffix and _NUMBER.fullmatch(p.stem)
    }
