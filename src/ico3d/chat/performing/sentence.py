"""Cuts the sound of sentences into the pieces that go to the page, with rows of expressions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ico3d.chat.performing.face import ROW, Face
from ico3d.chat.wire.protocol import EXPRESSION_FPS
from ico3d.common.espeak.speech import Phoneme
from ico3d.speech.emphasis import NEEDED

MOST, LEAST = 5, 3
"""Rows of a piece: 200 and 120 ms."""


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
        ahead = self._pcm[: (count + NEEDED) * ROW]
        pcm, self._pcm = self._pcm[: count * ROW], self._pcm[count * ROW :]
        lips, self._rows = np.stack(self._rows[:count]), self._rows[count:]  # (count, C)
        first = self._next
        self._next += count
        rows = self._face.rows(lips, ahead, self._start + first / EXPRESSION_FPS)
        return Piece(first, pcm, rows)
