"""The expression of each frame of a capture, and how the head is turned."""

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation
from torch import Tensor

from ico3d.capture.capture import Capture
from ico3d.common.expression import EYE_NAMES, SMILES, SPEECH_SIZE
from ico3d.errors import CaptureError
from ico3d.head.views import head_pose
from ico3d.speech.encoder import FrozenEncoder
from ico3d.speech.network import SpeechAdaptor, feature_windows

FEATURE_RATE = 25.0
"""Rows of speech features per second; other rates are resampled by time."""

TURN_WEIGHT = 0.4
"""Largest value of a head's rotation: it is learnt as fast as usual blendshapes of this size."""
USUAL = 0.3
"""Root mean square of a blendshape that is learnt as fast as `rates.basis` says."""
FASTEST = 4.0
"""Largest factor by which a row of the basis learns faster because its blendshape is small."""
MOOD = 0.4
"""Standard deviation in seconds of the filter by which a smile is told from what lips say."""
LEAST_TURN = 0.02
"""Angle in radians up to which a head counts as still: less is an error of its tracking."""

log = logging.getLogger(__name__)


class ExpressionTrack(Protocol):
    """The expressions of all frames of one capture.

    Attributes:
        size: B, the number of values of an expression.
    """

    size: int

    def at(self, frame: int) -> Tensor:
        """The expression (B,) of a frame; carries gradients if parts of the track are trained."""
        ...


class BlendshapeTrack:
    """Expressions made of blendshape weights that the capture contains."""

    def __init__(self, capture: Capture, names: tuple[str, ...]):
        """Reads the named blendshapes of all frames.

        Raises:
            CaptureError: If the capture has no blendshapes, or lacks one of the names.
        """
        available = capture.blendshape_names
        if available is None:
            raise CaptureError(
                f"{capture.path} has no blendshapes: train with --inputs speech, "
                "or record it with ico3d capture portrait."
            )
        missing = [name for name in names if name not in available]
        if missing:
            raise CaptureError(
                f"{capture.path} has no blendshape '{missing[0]}', the head needs it."
            )
        self.names, self.size = names, len(names)
        self._path = capture.path
        self._columns = [available.index(name) for name in names]
        self._capture = capture

    def at(self, frame: int) -> Tensor:
        """The blendshape weights (B,) of a frame.

        Raises:
            CaptureError: If the frame has no weights, or one is not finite.
        """
        values = self._capture.blendshapes(frame)
        if values is None or not np.isfinite(values).all():
            raise CaptureError(
                f"{self._path}: frame {frame} has no finite blendshapes: "
                "look at it with ico3d capture check."
            )
        return torch.from_numpy(np.asarray(values, np.float32)[self._columns])  # (B,)


def evening_rates(track: ExpressionTrack, frames: Iterable[int]) -> Tensor:
    """Factors (B,) of the learning rates of the basis' rows, by which small blendshapes keep up.

    A step of Adam or RMSProp moves all rows alike, however large their blendshapes are. So what a
    row does in the pictures is learnt with the square of its blendshape's size. A factor is the
    reciprocal of the root mean square over the frames, relative to `USUAL`, and at most `FASTEST`.
    It is 1 where the expression is learnt, too, and for blendshapes that never move.
    """
    if not isinstance(track, BlendshapeTrack):
        return torch.ones(track.size)
    sizes = torch.stack([track.at(frame) for frame in frames]).square().mean(0).sqrt()  # (B,)
    factors = USUAL / sizes.clamp_min(USUAL / FASTEST)  # (B,)
    return torch.where(sizes > 0, factors, 1.0)


def is_of_eyes(track: ExpressionTrack) -> Tensor:
    """(B,) which values of an expression move eyes or brows, and nothing at the mouth."""
    if isinstance(track, BlendshapeTrack):
        return torch.tensor([name.startswith(("eye", "brow")) for name in track.names])
    eyes = torch.zeros(track.size, dtype=torch.bool)
    if isinstance(track, SpeechTrack):
        eyes[SPEECH_SIZE : SPEECH_SIZE + len(EYE_NAMES)] = True
    return eyes


class SpeechTrack:
    """Expressions of 32 adapted speech features and 7 eye values, B = 39; B = 40 with a smile.

    Attributes:
        eyes: (F, 7) the eye values of all frames; (F, 8) with the smile.
    """

    def __init__(
        self,
        capture: Capture,
        features: np.ndarray,
        adaptor: SpeechAdaptor,
        needs_eyes: bool = True,
        smile: bool = False,
    ):
        """Combines sound features, adaptor, eye values and smile of one capture.

        Args:
            capture: Provides eye values and frame rate.
            features: (T, D) speech features, 25 rows per second.
            adaptor: Network from speech features to speech values.
            needs_eyes: Whether to warn if eye values are missing; a head that was trained without
                eye values does not need them.
            smile: Whether the smile is told, too.

        Raises:
            CaptureError: If a smile is wanted, and the capture has no blendshapes that tell it.
        """
        self._adaptor = adaptor
        self._fps = capture.fps
        self.eyes = eye_track(capture, needs_eyes)  # (F, 7)
        if smile:
            self.eyes = torch.cat([self.eyes, smile_track(capture)[:, None]], 1)  # (F, 8)
        self.size = SPEECH_SIZE + self.eyes.shape[1]
        self._features = torch.from_numpy(features)

    def at(self, frame: int) -> Tensor:
        """The expression (B,) of a frame, interpolated in time between rows of features."""
        position = min(frame / self._fps * FEATURE_RATE, len(self._features) - 1.0)
        lower = int(position)
        part = position - lower
        rows = torch.arange(lower, lower + 2 if part > 1e-6 else lower + 1)  # (1 or 2,)
        adapted = self._adaptor(feature_windows(self._features, rows))  # (1 or 2, 32)
        speech = torch.lerp(adapted[0], adapted[-1], part)  # (32,)
        return torch.cat([speech, self.eyes[frame]])


def eye_track(capture: Capture, needed: bool = True) -> Tensor:
    """The seven eye values (F, 7) of all frames.

    Missing values are 0; if `needed`, a warning is logged.
    """
    rows = [capture.eyes(frame) for frame in range(capture.num_frames)]
    lacking = [frame for frame, row in enumerate(rows) if row is None or not np.isfinite(row).all()]
    if lacking and needed:
        _say_eyes_are_missing(capture.path, len(lacking), len(rows), lacking[0])
    for frame in lacking:
        rows[frame] = np.zeros(len(EYE_NAMES), np.float32)
    return torch.from_numpy(np.stack(rows).astype(np.float32))  # type: ignore[arg-type]


def smile_track(capture: Capture) -> Tensor:
    """How much the person smiles (F,) in all frames, whatever the lips say.

    It is the mean of two blendshapes. Vowels stretch lips, too, for a tenth of a second, which is
    averaged away; a sound that drives a mouth tells the rest.

    Raises:
        CaptureError: If the capture has no such blendshapes.
    """
    names = capture.blendshape_names or ()
    if not set(SMILES) <= set(names):
        raise CaptureError(
            f"{capture.path} does not tell how much the person smiles, for it has no blendshapes: "
            "train without --smile, or record it with ico3d capture portrait."
        )
    columns = [names.index(name) for name in SMILES]
    rows = [capture.blendshapes(frame) for frame in range(capture.num_frames)]
    told = np.array([np.nan if row is None else row[columns].mean() for row in rows])  # (F,)
    known = np.isfinite(told)
    if not known.any():
        raise CaptureError(
            f"{capture.path}: no frame has finite blendshapes: look at it with ico3d capture check."
        )
    told = np.interp(np.arange(len(told)), np.flatnonzero(known), told[known])
    smooth = gaussian_filter1d(told, MOOD * capture.fps, mode="nearest")
    return torch.from_numpy(smooth.astype(np.float32))


@cache
def _say_eyes_are_missing(path: Path, lacking: int, frames: int, first: int) -> None:
    """One warning for each recording, however often its expressions are read."""
    if lacking == frames:
        log.warning("%s has no eye values: eyes and brows will not move.", path)
    else:
        log.warning(
            "%s: %d of %d frames have no eye values (first: %d); they count as open eyes.",
            path, lacking, frames, first,
        )  # fmt: skip


def speech_features(capture: Capture, encoder: FrozenEncoder, device: torch.device) -> np.ndarray:
    """Features (T, D) of a capture's sound, 25 rows per second, computed on `device`.

    Raises:
        CaptureError: If the capture has no sound.
    """
    sound = capture.audio()
    if sound is None:
        raise CaptureError(
            f"{capture.path} has no sound: train with --inputs blendshapes, or add a recording."
        )
    return encoder.features(sound.samples, sound.rate, device)


@dataclass(frozen=True)
class TurnRange:
    """How far the head of one person turned while it was recorded.

    Lamps stand still in a room. So what a head's surface looks like changes as the head turns.

    Attributes:
        mean: (4,) mean rotation of the head in the world, a unit quaternion, xyzw.
        most: (3,) largest angles in radians seen about the three axes of the world, from the mean.
    """

    mean: tuple[float, ...]
    most: tuple[float, ...]

    def values(self, rotation: np.ndarray) -> np.ndarray:
        """(..., 3) float32 values of rotations (..., 3, 3) in the world; 0 at the mean rotation.

        A head model is undefined outside of what it was trained with. So angles beyond the largest
        seen count as the largest.
        """
        away = (Rotation.from_matrix(rotation) * Rotation.from_quat(self.mean).inv()).as_rotvec()
        shares = np.clip(away / np.maximum(self.most, LEAST_TURN), -1, 1)
        return (TURN_WEIGHT * shares).astype(np.float32)


def turn_of(capture: Capture, frames: Iterable[int]) -> TurnRange:
    """How far the head turns in some frames, each of which has a head pose."""
    poses = [head_pose(capture, frame)[:3, :3] for frame in frames]
    rotations = Rotation.from_matrix(np.stack(poses))  # T of them
    mean = rotations.mean()
    most = np.abs((rotations * mean.inv()).as_rotvec()).max(axis=0)  # (3,)
    return TurnRange(
        tuple(round(float(value), 6) for value in mean.as_quat()),
        tuple(round(float(value), 6) for value in most),
    )


def turn_values(turn: TurnRange, capture: Capture, frames: Sequence[int]) -> Tensor:
    """The values (T, 3) of the head's rotation in T frames, which follow the expressions'."""
    poses = np.stack([head_pose(capture, frame)[:3, :3] for frame in frames])  # (T, 3, 3)
    return torch.from_numpy(turn.values(poses))
