"""Looks at pictures and parts with the face tracker, or, where it is missing, at their light."""

import threading
from pathlib import Path
from typing import Any

import numpy as np
from PIL import UnidentifiedImageError

from ico3d.capture.decoding import open_picture
from ico3d.capture.face.mediapipe_face import FaceReader
from ico3d.capture.video import open_video, opened, read_sound
from ico3d.common.typed import plain
from ico3d.common.weights import model_file
from ico3d.creating.looking.advice import Advice
from ico3d.creating.looking.examine import examine
from ico3d.creating.looking.picture_checks import picture_advice
from ico3d.creating.looking.samples import Samples, sample_of, sharpness_of
from ico3d.creating.looking.sound_checks import sound_advice
from ico3d.errors import CaptureError, Ico3dError, MissingExtraError, MissingModelError
from ico3d.recording.guiding.guide import GOALS, Told, extremes, instruct, without_faces
from ico3d.recording.keeping.plan import CONSENT, TURNS, UPLOAD, Turn
from ico3d.recording.refusals import Refused, costly, no_video, unusable

SIDE = 512
"""Upper limit of the short side of parts that are looked at, in pixels, as `ico3d create` has."""
MOST_SIDE = 2000
"""Largest side of a picture that a page may send."""
RATE = 3.0
"""Pictures per second of a part that are looked at."""
MIDDLE = 0.3
"""Share of a picture at each edge that is left out where nobody knows where the face is."""
OF_A_WHOLE = ("turns", "length", "lips", "exposure", "camera")
"""Advice that only a whole recording can follow."""


class Eye:
    """The tracker of faces, shared by all who record; one picture at a time."""

    def __init__(self):
        """Loads the tracker; without one, `lacking` says how to get it."""
        self._lock = threading.Lock()
        self._faces: FaceReader | None = None
        self.lacking = ""
        try:
            self._faces = FaceReader(model_file("face_landmarker.task", "guidance by the face"), 2)
        except (MissingModelError, MissingExtraError) as error:
            self.lacking = str(error)

    def close(self) -> None:
        """Frees the tracker."""
        with self._lock:
            if self._faces is not None:
                self._faces.__exit__()
            self._faces = None

    def told(self, jpeg: bytes, wanted: Turn | None) -> Told:
        """What to tell somebody who is seen in a picture.

        Args:
            jpeg: The picture.
            wanted: Way to turn the head, if that is what is being recorded.

        Raises:
            Refused: If it is no picture, or a large one.
        """
        picture = _decoded(jpeg)
        with self._lock:
            if self._faces is None:
                return without_faces(*_middle(picture))
            sample = sample_of(0.0, picture, self._faces, None)
        return instruct(sample, min(picture.shape[:2]), wanted)

    def report(self, file: Path, id: str) -> dict[str, Any]:
        """What is found in a part: its seconds, the turns of the head, advice.

        Args:
            file: The recording.
            id: The part.

        Returns:
            `seconds`; `turn`, degrees (least to the left, most, least up, most), None where no face
            was looked for or found; `advice`, what would make it better.

        Raises:
            Refused: If it is no video, a consent in which nothing is heard, or a whole video of
                which no avatar can be made.
        """
        from av.error import FFmpegError

        try:
            _check_size(file)
            if id == CONSENT:
                return _of_consent(file)
            return self._brought(file) if id == UPLOAD else self._found(file, id)
        except Refused:
            raise
        except (Ico3dError, FFmpegError, OSError, ValueError) as error:
            raise no_video() from error

    def _brought(self, file: Path) -> dict[str, Any]:
        """What is found in a whole video: all that `ico3d create` would look at."""
        if self._faces is None:
            report = self._found(file, UPLOAD)
            refused = [one for one in sound_advice(read_sound(file)) if one.level == "refused"]
            if refused:
                raise unusable(refused)
            return report
        found = examine(file, SIDE, lambda _: None)
        if found.refused:
            raise unusable(found.refused)
        seconds = round(found.seconds, 2)
        return {"seconds": seconds, "turn": None, "advice": [plain(one) for one in found.advice]}

    def _found(self, file: Path, id: str) -> dict[str, Any]:
        video = open_video(file, SIDE)
        heard = sound_advice(read_sound(file))
        seen: list[Advice] = []
        turn = None
        if self._faces is None:
            for _ in video.frames(RATE):
                pass
        else:
            samples = self._samples(video)
            seen = list(picture_advice(samples))
            turns = np.array([sample.turn for sample in samples.with_face])  # (S, 2)
            if len(turns):
                low, high = turns.min(0), turns.max(0)
                turn = [round(float(v), 1) for v in (low[0], high[0], low[1], high[1])]
        if video.decoded < 2:
            raise CaptureError(f"{file} is a picture.")
        said = [one for one in (*seen, *heard) if one.topic not in OF_A_WHOLE]
        told = [plain(one) for one in (*said, *short_of(id, turn))]
        return {"seconds": round(video.times[-1], 2), "turn": turn, "advice": told}

    def _samples(self, video: Any) -> Samples:
        found = []
        for number, picture in enumerate(video.frames(RATE)):
            with self._lock:  # between two pictures others are looked at
                if self._faces is None:
                    break
                found.append(sample_of(number / RATE, picture, self._faces, None))
        return Samples(tuple(found), 1 / RATE, min(video.width, video.height), False)


def turn_of(text: str) -> Turn | None:
    """The way to turn the head in a part; None for one in which the person looks ahead."""
    return next((turn for turn in TURNS if turn == text), None)


def _check_size(file: Path) -> None:
    """Refuses a video whose pictures would fill the memory, before one is decoded.

    Raises:
        Refused: If its file states larger ones than are taken, promises what it cannot hold, or
            takes too much to be opened.
    """
    try:
        opened(file).close()
    except CaptureError as error:
        if error.code == "decoding":
            raise no_video() from error
        if error.code == "costly":
            raise costly() from error
        text = "the pictures of this video are larger than is taken."
        raise Refused("large", text, 413) from error


def short_of(id: str, turn: list[float] | None) -> list[Advice]:
    """What is said of a turn of the head that did not go far enough; nothing of any other part."""
    way = turn_of(id)
    if way is None or turn is None or (share := extremes(turn)[way]) >= 1:
        return []
    goal = GOALS[way]
    return [Advice(f"short-{way}", "better", {"n": round(share * goal), "goal": round(goal)})]


def _of_consent(file: Path) -> dict[str, Any]:
    """What is found in a spoken consent, which may be without pictures."""
    sound = read_sound(file)
    if sound is None or any(one.level == "refused" for one in sound_advice(sound)):
        raise Refused("unheard", "nothing is heard: switch the microphone on, say it again.", 422)
    return {"seconds": round(len(sound.samples) / sound.rate, 2), "turn": None, "advice": []}


def _decoded(jpeg: bytes) -> np.ndarray:
    """(H, W, 3) uint8 RGB."""
    try:
        with open_picture(jpeg, "the picture", ("JPEG",)) as image:
            if max(image.size) > MOST_SIDE or min(image.size) < 32:
                raise Refused("picture", "the picture has an unusual size.", 422)
            return np.asarray(image.convert("RGB"))
    except CaptureError as error:
        raise Refused("picture", "the picture has an unusual form.", 422) from error
    except (UnidentifiedImageError, OSError, ValueError) as error:
        raise Refused("picture", "this is no JPEG picture.", 415) from error


def _middle(picture: np.ndarray) -> tuple[float, float | None]:
    """Brightness, 0 to 1, and sharpness of the middle of a picture; None without OpenCV."""
    height, width = picture.shape[:2]
    y, x = round(MIDDLE * height), round(MIDDLE * width)
    grey = picture[y : height - y, x : width - x].mean(-1).astype(np.float32) / 255
    try:
        return float(grey.mean()), sharpness_of(grey)
    except ImportError:
        return float(grey.mean()), None
