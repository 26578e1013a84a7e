"""A trained head with everything needed to drive it, as a model folder stores it."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import torch

from ico3d.capture.capture import Capture
from ico3d.capture.parts.trained_on import check_told
from ico3d.common.expression import EYE_NAMES, FACE_NAMES, SPEECH_SIZE, TURN_SIZE, EyeRange
from ico3d.common.files import json_of, resolved, write_atomic
from ico3d.errors import ModelError
from ico3d.head.expressions import (
    BlendshapeTrack,
    ExpressionTrack,
    SpeechTrack,
    TurnRange,
    speech_features,
)
from ico3d.head.model import HeadModel
from ico3d.head.views import poses_digest
from ico3d.speech.encoder import load_encoder
from ico3d.speech.network import SpeechAdaptor
from ico3d.training.checkpoint import DAMAGED, load_tensors, save_tensors

ABOUT = "head.json"
"""Name of the file that marks a folder as one of a head."""
SILENCE = 2
"""Seconds of silent sound, long enough that the middle is free of effects of the ends."""
MOST_FEATURES = 8192
"""Largest number of features per row that is believed; HuBERT has 2048."""
Inputs = Literal["speech", "blendshapes"]


@dataclass
class TrainedHead:
    """A head model, and how captures are turned into its expressions.

    Attributes:
        model: The Gaussians.
        inputs: What drives the head: `speech` or `blendshapes`.
        blendshape_names: The B names where `inputs` is `blendshapes`, else empty.
        encoder: Name of the speech encoder where `inputs` is `speech`, else empty.
        encoder_sha256: SHA-256 of the encoder's weights; the adaptor works with no other encoder.
        adaptor: The trained speech adaptor where `inputs` is `speech`, else None.
        summary: How the head was made: provenance of the capture, seconds of training, settings.
        landmarks: (68, 3) Multi-PIE landmarks in canonical head space, metres, by which the head is
            placed on a body; None where the capture has none.
        eyes: How far eyes, brows and, for a head that smiles, the smile moved in the recording;
            used where `inputs` is `speech`.
        turn: How far the head turned in the recording; None if the model ignores that.
    """

    model: HeadModel
    inputs: Inputs
    blendshape_names: tuple[str, ...]
    encoder: str
    encoder_sha256: str
    adaptor: SpeechAdaptor | None
    summary: dict
    landmarks: np.ndarray | None = None
    eyes: EyeRange = field(default_factory=EyeRange)
    turn: TurnRange | None = None

    def to(self, device: torch.device) -> "TrainedHead":
        """Moves the Gaussians to a device and returns this head; the adaptor stays on the CPU."""
        self.model.to(device)
        return self

    @property
    def records(self) -> list[dict]:
        """What trained the head and its colours, by `capture.parts.trained_on`."""
        return [self.summary.get(part, {}) for part in ("recording", "recoloured")]

    @property
    def over_torso(self) -> bool:
        """Whether the head alone was learnt, over the recorded torso of a portrait."""
        return self.summary.get("recording", {}).get("over_torso", False)

    @property
    def smiles(self) -> bool:
        """Whether the last value of an expression is a smile."""
        return self.adaptor is not None and len(self.eyes.rest) == len(FACE_NAMES)

    def track(self, capture: Capture) -> ExpressionTrack:
        """The expressions that drive this head through a capture.

        Raises:
            CaptureError: If the capture lacks the sound or the blendshapes that the head needs.
            ModelError: If the installed speech encoder is not the one of the training, or the
                capture is the training's recording but its head poses have changed.
        """
        trained_on = self.summary.get("recording", {})
        same = trained_on.get("path") == str(resolved(capture.path))
        if same and trained_on.get("poses") != poses_digest(capture):
            raise ModelError(
                f"the head poses of {capture.path} have changed since this head was trained with "
                "them (a track was made or removed): train it again."
            )
        if self.adaptor is None:
            return BlendshapeTrack(capture, self.blendshape_names)
        encoder = load_encoder(self.encoder)
        if encoder.sha256 != self.encoder_sha256:
            raise ModelError(
                f"this head was trained with another speech encoder '{self.encoder}' "
                f"({self.encoder_sha256[:12]}, not {encoder.sha256[:12]}): train it again."
            )
        features = speech_features(capture, encoder, self.model.device)  # (T, D)
        return SpeechTrack(
            capture,
            features,
            self.adaptor,
            needs_eyes=any(self.eyes.most[: len(EYE_NAMES)]),
            smile=self.smiles,
        )

    def neutral(self) -> np.ndarray:
        """The resting expression (B,) float32: silence, open eyes, brows at rest."""
        if self.adaptor is None:
            return np.zeros(self.model.shape.expression_size, np.float32)
        silence = np.zeros(16_000 * SILENCE, np.float32)
        encoder = load_encoder(self.encoder)
        features = torch.from_numpy(encoder.features(silence, 16_000, self.model.device))
        with torch.no_grad():
            rows = self.adaptor.track(features)  # (T, 32)
        return np.concatenate([rows[len(rows) // 2].numpy(), np.array(self.eyes.rest, np.float32)])

    def recorded(self, driven: np.ndarray) -> np.ndarray:
        """Converts expressions (..., B) of an avatar to those of the recording.

        An avatar and a bundle give eye values relative to this person: 0 is at rest, 1 as far as
        the person was seen to move. The head itself takes the values of the recording.
        """
        if self.adaptor is None:
            return driven
        speech, eyes = driven[..., :SPEECH_SIZE], driven[..., SPEECH_SIZE:]
        return np.concatenate([speech, self.eyes.values(eyes)], -1)

    def save(self, folder: Path) -> None:
        """Writes `model.safetensors`, `adaptor.safetensors` and `head.json` into a folder."""
        self.model.save(folder / "model.safetensors")
        if self.adaptor is not None:
            shape = {"features": self.adaptor.size, "vectors": self.adaptor.vectors}
            save_tensors(folder / "adaptor.safetensors", dict(self.adaptor.state_dict()), shape)
        about = {
            "inputs": self.inputs,
            "blendshape_names": list(self.blendshape_names),
            "encoder": self.encoder,
            "encoder_sha256": self.encoder_sha256,
            "summary": self.summary,
            "landmarks": None if self.landmarks is None else self.landmarks.round(6).tolist(),
            "eyes": asdict(self.eyes),
            "turn": None if self.turn is None else asdict(self.turn),
        }
        write_atomic(folder / ABOUT, json.dumps(about, indent=1).encode())

    @classmethod
    def load(cls, folder: Path | str) -> "TrainedHead":
        """Reads a folder that `save` wrote.

        Raises:
            ModelError: If the folder holds no trained head, or a file is damaged.
        """
        folder = Path(folder)
        try:
            about = json_of(folder / ABOUT)
            inputs, names = about["inputs"], tuple(about["blendshape_names"])
            encoder = about["encoder"], about["encoder_sha256"]
            summary, landmarks = about["summary"], _landmarks(about.get("landmarks"))
            eyes, turn = _eyes(about.get("eyes")), _turn(about.get("turn"))
            _check_driven(inputs, names, *encoder)
            check_told(summary)
        except DAMAGED as error:
            raise ModelError(
                f"{folder} holds no trained head ({error}): train one with ico3d train head."
            ) from error
        adaptor = _load_adaptor(folder / "adaptor.safetensors") if inputs == "speech" else None
        model = HeadModel.load(folder / "model.safetensors")
        return cls(model, inputs, names, *encoder, adaptor, summary, landmarks, eyes, turn)


def _check_driven(inputs: object, names: Iterable[object], *encoder: object) -> None:
    """Raises ValueError if a folder does not say in words what drives its head."""
    if inputs not in get_args(Inputs):
        raise ValueError(f"nothing called {inputs!r:.40} drives heads")
    if not all(isinstance(word, str) for word in (*names, *encoder)):
        raise ValueError("it names blendshapes or its encoder by something else than words")


def _landmarks(values: list | None) -> np.ndarray | None:
    """(68, 3); heads of earlier versions say nothing of them.

    Raises:
        ValueError: If it is something else.
    """
    if values is None:
        return None
    landmarks = np.asarray(values, np.float64)
    if landmarks.shape != (68, 3) or not np.isfinite(landmarks).all():
        raise ValueError("landmarks must be 68 points")
    return landmarks


def _eyes(values: dict | None) -> EyeRange:
    """Heads of earlier versions say nothing of them, and count from 0 to 1.

    Raises:
        ValueError: If it is something else.
        KeyError, TypeError: If values are missing or no lists.
    """
    if values is None:
        return EyeRange()
    rows = np.array([values["rest"], values["most"]], np.float64)  # (2, 7 or 8)
    known = rows.shape in ((2, len(EYE_NAMES)), (2, len(FACE_NAMES)))
    whole = known and np.isfinite(rows).all()
    if not whole or (rows[1] < rows[0]).any():
        raise ValueError("eyes must be seven or eight values at rest, and others not lower")
    return EyeRange(tuple(rows[0].tolist()), tuple(rows[1].tolist()))


def _turn(values: dict | None) -> TurnRange | None:
    """Heads of earlier versions say nothing of it.

    Raises:
        ValueError: If it is something else.
        KeyError, TypeError: If values are missing or no lists.
    """
    if values is None:
        return None
    mean, most = np.array(values["mean"], np.float64), np.array(values["most"], np.float64)
    whole = mean.shape == (4,) and most.shape == (TURN_SIZE,) and np.isfinite(most).all()
    if not whole or not abs(np.linalg.norm(mean) - 1) < 1e-3:
        raise ValueError("turn must be a unit quaternion, and three angles")
    return TurnRange(tuple(mean.tolist()), tuple(most.tolist()))


def _load_adaptor(path: Path) -> SpeechAdaptor:
    tensors, state = load_tensors(path)
    try:
        size, vectors = int(state["features"]), int(state.get("vectors", 1))
        if not 1 <= vectors <= size <= MOST_FEATURES:
            raise ValueError(f"no speech encoder gives {size} features in {vectors} vectors")
        adaptor = SpeechAdaptor(size, vectors)
        adaptor.restore(tensors)
    except DAMAGED as error:
        raise ModelError(f"{path} does not hold a speech adaptor ({error}).") from error
    return adaptor
