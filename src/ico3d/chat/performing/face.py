"""The face that belongs to a sound: sentences in, pieces of sound with expression rows out."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ico3d.bundle.format import SPEECH, Bundle
from ico3d.bundle.manifest import HeadInfo
from ico3d.chat.performing.moods import Moods
from ico3d.chat.performing.remote_mouth import RemoteMouth
from ico3d.chat.wire.protocol import EXPRESSION_FPS, SPEECH_RATE
from ico3d.common.expression import expression_rows
from ico3d.errors import BundleError
from ico3d.speech.eyes import EyeBehaviour
from ico3d.speech.runtime import SpeechModel, StreamingExpressions, open_speech

ROW = SPEECH_RATE // EXPRESSION_FPS  # samples of one row
MOST, LEAST = 5, 3  # rows of a piece: 200 and 120 ms


class Lips(Protocol):
    """The mouth's part of the rows of one sentence, as its sound arrives."""

    def push(self, samples: np.ndarray) -> np.ndarray:
        """Takes (S,) samples in [-1, 1]; returns the rows (n, C) known now."""
        ...

    def finish(self) -> np.ndarray:
        """Ends the sentence; returns the remaining rows (n, C)."""
        ...


class Face:
    """What all sentences of one session share: the model, and eyes that live on."""

    def __init__(
        self,
        info: HeadInfo,
        model: SpeechModel | None,
        seed: int,
        remote: RemoteMouth | None = None,
    ):
        """A face.

        Args:
            info: What the head can do.
            model: Sound to mouth; without one (heads driven by blendshapes) only the eyes move.
            seed: Of the eyes' behaviour.
            remote: Moves the mouth instead of the model.
        """
        self.moods = Moods()
        self._info = info
        self._model, self._remote = model, remote
        self._eyes = EyeBehaviour(seed)

    @property
    def is_remote(self) -> bool:
        """Whether another machine moves the mouth."""
        return self._remote is not None

    def lips(self) -> Lips:
        """The mouth for a new sentence."""
        if self._remote is not None:
            return self._remote.lips()
        if self._model is not None:
            return StreamingExpressions(self._model, SPEECH_RATE)
        return StillLips()

    def close(self) -> None:
        """Nothing more will be said."""
        if self._remote is not None:
            self._remote.close()

    def rows(self, lips: np.ndarray, start: float) -> np.ndarray:
        """Whole expression rows.

        Args:
            lips: (n, C) what the mouth does; C = 0 for a mouth at rest.
            start: Time of the first row in the session, seconds (eyes run on that clock).

        Returns:
            (n, B) float32.
        """
        times = start + np.arange(len(lips)) / EXPRESSION_FPS
        idle, at = np.array(self._info.idle_expression), self._info.eye_offset
        eyes = np.clip(self._eyes.values(times) + self.moods.values(times), 0, 1)
        return expression_rows(idle, lips, eyes, at)


class StillLips:
    """A mouth at rest: rows without values, as many as the sound is long."""

    def __init__(self):
        """No sound yet."""
        self._samples = 0
        self._given = 0

    def push(self, samples: np.ndarray) -> np.ndarray:
        """(n, 0) for every row whose sound is there."""
        self._samples += len(samples)
        rows = np.zeros((self._samples // ROW - self._given, 0), np.float32)
        self._given += len(rows)
        return rows

    def finish(self) -> np.ndarray:
        """(0, 0): a mouth at rest holds no rows back."""
        return np.zeros((0, 0), np.float32)


def open_face(bundle: Bundle) -> tuple[HeadInfo, SpeechModel | None]:
    """What a server needs of a bundle to move its face; the model serves all sessions.

    Raises:
        BundleError: If the bundle has no head.
        MissingModelError: If it needs a speech encoder that is not on this machine.
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
    """A part of a sentence that goes out as one message.

    Attributes:
        first_row: Index in the utterance of its first row; its sound starts there too.
        pcm: (rows · 960,) int16.
        expressions: (rows, B) float32.
    """

    first_row: int
    pcm: np.ndarray
    expressions: np.ndarray


class Sentence:
    """Cuts one sentence into pieces of 120-200 ms as soon as their rows are known.

    A sentence is padded with silence to whole rows, so that the next one starts on a row too.
    """

    def __init__(self, face: Face, first_row: int, start: float):
        """A sentence that begins at row `first_row` of its utterance.

        Args:
            face: The session's face.
            first_row: Where in the utterance it begins.
            start: Time of the utterance's row 0 in the session, seconds.
        """
        self._face, self._lips = face, face.lips()
        self._start = start
        self._next = first_row
        self._length = 0  # samples that came
        self._pcm = np.zeros(0, np.int16)  # not yet given out
        self._rows: list[np.ndarray] = []  # of the mouth, not yet given out

    @property
    def next_row(self) -> int:
        """The row after the last one given out."""
        return self._next

    def push(self, pcm: np.ndarray) -> list[Piece]:
        """Takes (S,) int16 samples at 24 kHz; returns the pieces that are complete."""
        self._take(pcm)
        pieces = []
        while len(self._rows) >= MOST + LEAST:  # enough stays back for a last piece
            pieces.append(self._cut(MOST))
        return pieces

    def finish(self) -> list[Piece]:
        """Ends the sentence; returns what is left, in pieces of about one size."""
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
