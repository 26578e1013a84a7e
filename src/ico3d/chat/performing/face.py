"""Computes faces for sound: sentences in, pieces of sound with rows of expressions out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ico3d.bundle.format import SPEECH, Bundle
from ico3d.bundle.manifest import HeadInfo
from ico3d.chat.performing.moods import Moods
from ico3d.chat.performing.remote_mouth import RemoteMouth
from ico3d.chat.wire.protocol import EXPRESSION_FPS, SPEECH_RATE
from ico3d.common.espeak import Phoneme
from ico3d.common.expression import expression_rows
from ico3d.errors import BundleError
from ico3d.speech.eyes import EyeBehaviour
from ico3d.speech.runtime import SpeechModel, StreamingExpressions, open_speech

ROW = SPEECH_RATE // EXPRESSION_FPS  # samples of one row
MOST, LEAST = 5, 3  # rows of a piece: 200 and 120 ms


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
    """The face of one session: the speech model, and eyes that keep moving between sentences."""

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
        self._eyes = EyeBehaviour(seed)

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

    def rows(self, lips: np.ndarray, start: float) -> np.ndarray:
        """Full rows of expressions from mouth values.

        Args:
            lips: (n, C) mouth values; C = 0 for a mouth at rest.
            start: Time of the first row on the session's clock in seconds, which the eyes follow.

        Returns:
            (n, B) float32.
        """
        times = start + np.arange(len(lips)) / EXPRESSION_FPS
        idle, at = np.array(self._info.idle_expression), self._info.eye_offset
        eyes = np.clip(self._eyes.values(times) + self.moods.values(times), 0, 1)
        return expression_rows(idle, lips, eyes, at)


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


@dataclass(frozen=True)
class Piece:
    """A piece of a sentence that is sent as one message.

    Attributes:
        first_row: Index of the piece's first row in the utterance; its sound starts at the same
            time.
        pcm: (rows · 960,) int16 at 24 kHz.
        expressions: (rows, B) float32.
    """

    first_row: int
    pcm: np.ndarray
    expressions: np.ndarray


class Sentence:
    """Cuts one sentence into pieces of 120 to 200 ms as soon as their rows are known.

    A sentence is padded with silence to whole rows, so that the next one starts on a row.
    """

    def __init__(self, face: Face, first_row: int, start: float):
        """Starts a sentence at row `first_row` of its utterance.

        Args:
            face: The face of the session.
            first_row: Row of the utterance at which the sentence starts.
            start: Time of the utterance's row 0 on the session's clock, seconds.
        """
        self._face, self._lips = face, face.lips()
        self._start = start
        self._next = first_row
        self._length = 0  # samples that came
        self._pcm = np.zeros(0, np.int16)  # not yet given out
        self._rows: list[np.ndarray] = []  # of the mouth, not yet given out

    @property
    def next_row(self) -> int:
        """Index of the row after the last one that was returned."""
        return self._next

    def tell(self, phonemes: Sequence[Phoneme], seconds: float) -> None:
        """Says which phonemes the next seconds of sound hold, before the first of its samples."""
        self._lips.tell(phonemes, seconds)

    def push(self, pcm: np.ndarray) -> list[Piece]:
        """Adds samples (S,) int16 at 24 kHz; returns the pieces that are now complete."""
        self._take(pcm)
        pieces = []
        while len(self._rows) >= MOST + LEAST:  # enough stays back for a last piece
            pieces.append(self._cut(MOST))
        return pieces

    def finish(self) -> list[Piece]:
        """Ends the sentence; returns the rest in pieces of similar size."""
        if self._length == 0:
            return []
        total = max(LEAST, -(-self._length // ROW))
        self._take(np.zeros(total * ROW - self._length, np.int16))
        self._rows.extend(self._lips.finish())
        left = len(self._pcm) // ROW
        self._rows = self._rows[:left]  # the model knows one row more than there is sound
        count = -(-left // MOST)
        return [self._cut(left * (i + 1) // count - left * i // count) for i in range(count)]

    def _take(self, pcm: np.ndarray) -> None:
        self._length += len(pcm)
        self._pcm = np.concatenate([self._pcm, pcm])
        self._rows.extend(self._lips.push(pcm.astype(np.float32) / 32768))

    def _cut(self, count: int) -> Piece:
        pcm, self._pcm = self._pcm[: count * ROW], self._pcm[count * ROW :]
        lips, self._rows = np.stack(self._rows[:count]), self._rows[count:]  # (count, C)
        first = self._next
        self._next += count
        rows = self._face.rows(lips, self._start + first / EXPRESSION_FPS)
        return Piece(first, pcm, rows)
