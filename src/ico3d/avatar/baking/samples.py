"""What a head is baked from: expressions, and how much each logit matters in pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ico3d.avatar import staging
from ico3d.avatar.baking.head_cost import Reference, reference
from ico3d.avatar.baking.importance import logit_importance
from ico3d.capture.capture import Capture
from ico3d.common.camera import Camera, look_at
from ico3d.common.espeak.speech import synthesize
from ico3d.common.expression import SPEECH_SIZE, expression_rows
from ico3d.common.spread import spread
from ico3d.head.expressions import FEATURE_RATE, ExpressionTrack
from ico3d.head.model import HeadModel
from ico3d.head.model_folder import TrainedHead
from ico3d.head.views import view_of
from ico3d.speech.encoder import load_encoder
from ico3d.speech.eyes import EyeBehaviour

_PROBES = 32
"""Pictures from which the importance of logits is estimated."""
_SIZE, _FOV = 192, 20.0
"""Side in pixels, and field of view in degrees, of pictures drawn without a recording."""
_SIDES = np.deg2rad([0, -35, 20, 60, -15, 40, -60, -5])
"""Azimuths in radians of the cameras that draw them, 0 in front, taken in turn."""
_SMILE = 7.0
"""Seconds in which a smile comes and goes."""
_VOICES = ("en-us", "en-us+f3", "en-us+m3", "en-us+f5")
"""Voices of espeak-ng that read texts in turn."""


@dataclass(frozen=True)
class Samples:
    """Expressions that a head is baked from.

    Attributes:
        expressions: (T, B) expressions in which the baked head has to look right.
        importance: (N, 4) how much an error in each logit matters, see `logit_importance`.
    """

    expressions: np.ndarray
    importance: np.ndarray


def recorded_samples(head: TrainedHead, capture: Capture) -> Samples:
    """Samples from a capture: expressions of training frames, importance as its cameras see."""
    track = head.track(capture)
    expressions = expressions_at(track, capture.split.train)
    return Samples(expressions, _importance(head, capture, track))


def samples_around(head: TrainedHead, expressions: np.ndarray) -> Samples:
    """Samples from expressions (T, B): importance is as virtual cameras around the face see."""
    rows = np.linspace(0, len(expressions) - 1, _PROBES).round().astype(int)
    probes = torch.from_numpy(np.asarray(expressions[rows], np.float32))  # (P, B)
    cameras = cameras_around(head.model, _PROBES)
    colour = torch.tensor(staging.NEUTRAL)
    importance = logit_importance(head.model, probes, cameras, colour, seed=0)
    return Samples(expressions, importance)


def references_around(head: TrainedHead, expressions: np.ndarray, count: int) -> list[Reference]:
    """Pictures of the exact head by virtual cameras around the face, without ground truth.

    Args:
        head: The exact head.
        expressions: (T, B), from which the pictures' expressions are taken evenly.
        count: Number of pictures at most.
    """
    rows = spread(len(expressions), count)
    cameras, colour = cameras_around(head.model, len(rows)), torch.tensor(staging.NEUTRAL)
    shown = torch.from_numpy(np.asarray(expressions[rows], np.float32))  # (V, B)
    pairs = zip(cameras, shown, strict=True)
    return [reference(head, camera, expression, colour) for camera, expression in pairs]


def expressions_at(track: ExpressionTrack, frames: Sequence[int]) -> np.ndarray:
    """(T, B) expressions of T frames."""
    with torch.no_grad():
        return np.stack([track.at(frame).numpy() for frame in frames])


def spoken_expressions(head: TrainedHead, texts: Sequence[str], seed: int = 0) -> np.ndarray:
    """(T, B) expressions, 25 per second, of a head driven by speech that reads texts aloud.

    Synthetic voices read the texts; eyes blink and move by themselves, and a smile comes and goes.

    Args:
        head: A head driven by speech.
        texts: At least one text.
        seed: Seed of the eyes' movements.

    Raises:
        MissingExtraError: If espeak-ng is not installed.
    """
    rows = []
    for number, text in enumerate(texts):
        speech = synthesize(text, _VOICES[number % len(_VOICES)], rate=150)
        rows.append(lips_of(head, speech.samples, speech.rate))
    lips = np.concatenate(rows)
    times = np.arange(len(lips)) / FEATURE_RATE
    smile = 0.5 - 0.5 * np.cos(2 * np.pi * times / _SMILE)  # (T,)
    face = np.column_stack([EyeBehaviour(seed).values(times), smile])  # (T, 8)
    rest = np.zeros(SPEECH_SIZE + len(head.eyes.rest), np.float32)  # (B,)
    return head.recorded(expression_rows(rest, lips, face, SPEECH_SIZE))


def lips_of(head: TrainedHead, samples: np.ndarray, rate: int) -> np.ndarray:
    """(T, 32) speech values, 25 rows per second, of a head driven by speech.

    Args:
        head: A head driven by speech.
        samples: (S,) sound.
        rate: Samples per second.
    """
    assert head.adaptor is not None
    encoder = load_encoder(head.encoder)
    features = torch.from_numpy(encoder.features(samples, rate, head.model.device))  # (T, D)
    with torch.no_grad():
        return head.adaptor.track(features).numpy()


def _importance(head: TrainedHead, capture: Capture, track: ExpressionTrack) -> np.ndarray:
    """(N, 4) importance of each logit in training frames, seen by the capture's cameras in turn."""
    frames = capture.split.train
    frames = [frames[i] for i in np.linspace(0, len(frames) - 1, _PROBES).astype(int)]
    frames = [frame for frame in frames if capture.world_from_head(frame) is not None]
    cameras = [view_of(capture, i % len(capture.cameras), f).camera for i, f in enumerate(frames)]
    expressions = torch.from_numpy(expressions_at(track, frames))  # (P, B)
    colour = torch.tensor(staging.background_colour(capture, 0))
    return logit_importance(head.model, expressions, cameras, colour, seed=0)


def cameras_around(model: HeadModel, count: int) -> list[Camera]:
    """Cameras in canonical head space before and beside the face, with all of the head in view."""
    means = model.means.detach().cpu().numpy()
    low, high = np.percentile(means, (0.5, 99.5), axis=0)  # (3,), (3,)
    middle, half = (low + high) / 2, np.linalg.norm(high - low) / 2
    away = half / np.sin(np.deg2rad(_FOV) / 2)
    focal = 0.5 * _SIZE / np.tan(np.deg2rad(_FOV) / 2)
    intrinsics = np.array([[focal, 0, _SIZE / 2], [0, focal, _SIZE / 2], [0, 0, 1]])
    sides = [_SIDES[i % len(_SIDES)] for i in range(count)]
    eyes = [middle + away * np.array([np.sin(a), 0.1, np.cos(a)]) for a in sides]
    return [Camera(_SIZE, _SIZE, intrinsics, look_at(eye, middle)) for eye in eyes]
