"""The face of one session: rows of expressions for sound, eyes and brows."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ico3d.bundle.format import SPEECH, Bundle
from ico3d.bundle.manifest import HeadInfo
from ico3d.chat.performing.moods import Moods
from ico3d.chat.performing.remote_mouth import RemoteMouth
from ico3d.chat.wire.protocol import EXPRESSION_FPS, SPEECH_RATE
from ico3d.common.espeak.speech import Phoneme
from ico3d.common.expression import expression_rows
from ico3d.errors import BundleError
from ico3d.speech.emphasis import Emphasis
from ico3d.speech.eyes import EyeBehaviour
from ico3d.speech.runtime import SpeechModel, StreamingExpressions, open_speech

ROW = SPEECH_RATE // EXPRESSION_FPS  # samples of one row


class Lips(Protocol):
    """Mouth values of the rows of one sentence, computed while its sound arrives."""

    def tell(self, phonemes: Sequence[Phoneme], seconds: float) -> None:
        """Says which phonemes the next seconds of sound hold, before the first of its samples."""
        ...

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Adds samples (S,) in [-1, 1]; returns the rows (n, C) that are now known."""
        ...

    def finish(self) -> np.ndarray:
        """Ends the sentence; returns the remaining rows (n, C)."""
        ...


class Face:
    """The face of one session: the speech model, moods, and eyes that move between sentences."""

    def __init__(
        self,
        info: HeadInfo,
        model: SpeechModel | None,
        seed: int,
        remote: RemoteMouth | None = None,
    ):
        """Creates the face of one session.

        Args:
            info: Sizes of the baked head.
            model: Model from sound to mouth; without one (heads driven by blendshapes) only the
                eyes move.
            seed: Seed of the eyes' behaviour.
            remote: Computes the mouth on another machine instead of by the model.
        """
        self.moods = Moods()
        self._info = info
        self._model, self._remote = model, remote
        self._eyes, self._emphasis = EyeBehaviour(seed), Emphasis()

    @property
    def is_remote(self) -> bool:
        """Whether another machine computes the mouth."""
        return self._remote is not None

    def lips(self) -> Lips:
        """A new object for the mouth of one sentence."""
        if self._remote is not None:
            return self._remote.lips()
        if self._model is not None:
            return StreamingExpressions(self._model, SPEECH_RATE)
        return StillLips()

    def close(self) -> None:
        """Closes the connection to a remote mouth, if there is one."""
        if self._remote is not None:
            self._remote.close()

    def rows(self, lips: np.ndarray, sound: np.ndarray, start: float) -> np.ndarray:
        """Full rows of expressions from mouth values.

        Args:
            lips: (n, C) mouth values; C = 0 for a mouth at rest.
            sound: (S,) int16 at 24 kHz from the first row on, which the brows follow: of these rows
                and what is known after them.
            start: Time of the first row on the session's clock in seconds, which the eyes follow.

        Returns:
            (n, B) float32.
        """
        times = start + np.arange(len(lips)) / EXPRESSION_FPS
        idle, at = np.array(self._info.idle_expression), self._info.eye_offset
        stressed = self._emphasis.values(times, sound.astype(np.float32) / 32768, SPEECH_RATE)
        face = self.moods.values(times)  # (n, 8)
        face[:, : stressed.shape[1]] += self._eyes.values(times) + stressed
        return expression_rows(idle, lips, np.clip(face, 0, 1), at)


class StillLips:
    """A mouth at rest: as many rows as the sound has, without values."""

    def __init__(self):
        """Starts a sentence."""
        self._samples = 0
        self._given = 0

    def tell(self, phonemes: Sequence[Phoneme], seconds: float) -> None:
        """Phonemes move no mouth at rest."""

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Adds samples; returns (n, 0) for rows whose sound has arrived."""
        self._samples += len(samples)
        rows = np.zeros((self._samples // ROW - self._given, 0), np.float32)
        self._given += len(rows)
        return rows

    def finish(self) -> np.ndarray:
        """Returns (0, 0), because no rows are outstanding."""
        return np.zeros((0, 0), np.float32)


def open_face(bundle: Bundle) -> tuple[HeadInfo, SpeechModel | None]:
    """Sizes of a bundle's head and its speech model, which all sessions share.

    Raises:
        BundleError: If the bundle has no head.
        MissingModelError: If the bundle needs a speech encoder that is not installed.
        ModelError: If the bundle's speech model cannot be used.
    """
    info = bundle.manifest.head
    if info is None:
        raise BundleError(f"the bundle of '{bundle.manifest.name}' has no head to talk with.")
    speech = bundle.manifest.speech
    if speech is None:
        return info, None
    about = speech.encoder, speech.sha256, speech.input
    return info, open_speech(bundle.read(SPEECH), *about)
