"""Distinguishes the avatar's own sound, picked up by the microphone, from a visitor's voice.

Browsers cancel echo; this module handles the rest, and loudspeakers that browsers do not know of.
It compares energies in bands, which, unlike samples, survive a room, a codec and two unsynchronised
clocks. The page sends with each piece of sound what the loudspeaker was playing, so network delays
do not matter. Delay and loudness of the echo are learnt from the sound itself.
"""

from collections import deque

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ico3d.chat.turns.bands import COUNT, FRAME, Bands
from ico3d.chat.wire.protocol import MICROPHONE_RATE, SPEECH_RATE

HISTORY = 100  # frames that are compared: 2 s
LATEST = 30  # frames within which an echo comes
FIRST_GAIN = 1.0  # power of an echo nothing is known of: as loud as what was sent
ENOUGH = 10  # frames of sound without which nothing can be learnt
FALL = 8.0  # the most by which a gain becomes smaller at once
ALIKE = 0.55  # correlation from which the microphone hears the avatar
MARGIN = 4.0  # how much stronger than its echo a voice must be in a band: 6 dB
LOOSE = 3  # frames by which the page may be wrong about that for a moment
DECAY = 0.6  # of a room's reverberation per frame: 60 dB in 0.54 s
SHARE = 0.4  # of the energy that must be no echo in a voice
VOICED = 3  # such frames among the last 5 make a voice
CLEAR = 30.0  # how much stronger than its echo and the room a voice is beyond doubt: 15 dB
AFTER = 15  # frames for which a voice goes on after the last such frame
LEARN_EVERY = 10  # frames
SILENT = 1e-9  # mean square
BEHIND = 500  # frames for which what was sent is known: 10 s
UNHEARD = 3000  # frames of sound that wait to be heard: 60 s, and a page is sent 2 s ahead
ROOM = 3e-7  # mean square of a band; noise of a quiet room


class SentSound:
    """Band energies of the avatar's speech, by utterance and time.

    Times are asked for in order; what lies more than `BEHIND` frames before the latest one is
    forgotten.
    """

    def __init__(self):
        """Starts empty."""
        self._bands = Bands(SPEECH_RATE)
        self._utterance = -1
        self._forget()

    def add(self, utterance: int, pcm: np.ndarray) -> None:
        """Adds the next samples (n,) int16 at 24 kHz of an utterance."""
        if utterance != self._utterance:
            self._utterance = utterance
            self._forget()
        self._fresh.append(pcm)
        self._waiting += len(pcm)
        self._leave_out(self._waiting - UNHEARD * self._bands.length)

    def at(self, utterance: int | None, seconds: float) -> np.ndarray:
        """Energies (COUNT,) around a time of an utterance; 0 in silence (None)."""
        row = int(seconds / FRAME) if utterance == self._utterance else -1
        if row >= self._first + len(self._rows) and self._fresh:
            self._look(row)
        index = row - self._first
        return self._rows[index] if 0 <= index < len(self._rows) else np.zeros(COUNT)

    def _look(self, row: int) -> None:
        """Takes the energies around a frame; while no microphone is open nobody needs them."""
        length = self._bands.length
        self._leave_out((row - BEHIND) * length - self._begin)
        wanted = (row + 1) * length - self._begin
        taken, count = [np.zeros(0, np.int16)], 0
        while self._fresh and count < wanted:
            taken.append(self._fresh.popleft())
            count += len(taken[-1])
        whole = count - count % length
        samples = np.concatenate(taken)
        if whole < count:
            self._fresh.appendleft(samples[whole:])
        new = self._bands.energies(samples[:whole] / 32768)
        kept = self._rows[-BEHIND:]
        self._first = self._begin // length - len(kept)
        self._rows = np.concatenate([kept, new])
        self._begin += whole
        self._waiting -= whole

    def _leave_out(self, samples: int) -> None:
        """Forgets so many samples that nobody has looked at, but whole frames, and all before."""
        samples -= samples % self._bands.length
        if samples <= 0:
            return
        samples = min(samples, self._waiting - self._waiting % self._bands.length)
        self._begin += samples
        self._waiting -= samples
        self._rows, self._first = np.zeros((0, COUNT)), self._begin // self._bands.length
        while samples:
            piece = self._fresh.popleft()
            if len(piece) > samples:
                self._fresh.appendleft(piece[samples:])
            samples -= min(samples, len(piece))

    def _forget(self) -> None:
        self._rows, self._first = np.zeros((0, COUNT)), 0  # energies, and the frame of the first
        self._fresh: deque[np.ndarray] = deque()  # sound that nobody has looked at
        self._begin = self._waiting = 0  # its first sample, and how many there are


class EchoGuard:
    """Decides for each piece of microphone sound whether it contains only echo."""

    def __init__(self):
        """Starts without knowledge of the room's echo."""
        self.sent = SentSound()
        self._bands = Bands(MICROPHONE_RATE)
        self._rest = np.zeros(0)
        self._far = np.zeros((HISTORY + LATEST, COUNT))  # of the avatar, newest last
        self._near = np.zeros((HISTORY, COUNT))  # of the microphone
        self._gains = np.full(COUNT, FIRST_GAIN)
        self._lag: int | None = None  # frames
        self._fresh = 0  # frames since it last learnt
        self._marks = np.zeros(5, bool)  # which of the last frames were more than echo
        self._since_voice = AFTER
        self._before: tuple[int | None, float] = None, 0.0  # what was heard before this piece

    @property
    def lag(self) -> float | None:
        """Delay of the echo in seconds; None if there is no echo."""
        return None if self._lag is None else self._lag * FRAME

    @property
    def gain(self) -> float:
        """Gain of the echo in dB, from sent to recorded sound; maximum over the bands."""
        return float(10 * np.log10(self._gains.max() + 1e-12))

    def is_echo(self, pcm: np.ndarray, playing: int | None, position: float) -> bool:
        """Whether a piece of microphone sound contains no voice but the avatar's.

        Args:
            pcm: (n,) int16 at 16 kHz.
            playing: Number of the utterance that is playing at the end of the piece; None in
                silence.
            position: Seconds of that utterance that have been heard at the end of the piece.
        """
        samples = np.concatenate([self._rest, pcm / 32768])
        count = len(samples) // self._bands.length
        self._rest = samples[count * self._bands.length :]
        rows = self._bands.energies(samples[: count * self._bands.length])
        before, self._before = self._before, (playing, position)
        if playing is None:  # it may have fallen silent at any moment of this piece
            playing, position = before[0], before[1] + len(pcm) / MICROPHONE_RATE
        position -= len(self._rest) / MICROPHONE_RATE  # where the last whole frame ends
        for index, row in enumerate(rows):
            self._hear(row, self.sent.at(playing, position - (count - index) * FRAME))
        return self._speaks() and self._since_voice >= AFTER

    def _hear(self, near: np.ndarray, far: np.ndarray) -> None:
        self._near = np.concatenate([self._near[1:], near[None]])
        self._far = np.concatenate([self._far[1:], far[None]])
        self._fresh += 1
        if self._fresh >= LEARN_EVERY:
            self._fresh = 0
            self._learn()
        expected = self._expected()
        excess = np.clip(near - MARGIN * expected - ROOM, 0, None).sum()
        self._marks = np.append(self._marks[1:], excess > SHARE * near.sum() + SILENT)
        # One frame is enough where hardly any echo is left: words begin with it.
        clear = near.sum() > CLEAR * (expected + ROOM).sum()
        voiced = clear or self._marks.sum() >= VOICED
        self._since_voice = 0 if voiced else self._since_voice + 1

    def _speaks(self) -> bool:
        """Whether something of the avatar's may still be in the air."""
        return bool((self._far[-LATEST:].sum(axis=1) > SILENT).any())

    def _expected(self) -> np.ndarray:
        """(COUNT,) the most that an echo can be in the newest frame."""
        if self._lag is None:
            return self._gains * self._far[-LATEST:].max(axis=0)
        last = len(self._far) - 1 - self._lag
        around = self._far[last - 8 : last + 1 + LOOSE]
        reach = DECAY ** np.clip(np.arange(len(around))[::-1] - 2 * LOOSE, 0, None)
        return self._gains * (around * reach[:, None]).max(axis=0)

    def _learn(self) -> None:
        """Finds the lag at which the microphone resembles the avatar, and how loud it is."""
        if not (self._far > SILENT).any():
            return
        lag, alike = self._best_lag()
        echoes = alike >= ALIKE
        if echoes:
            self._lag = lag
        far = self._lagged(LATEST if self._lag is None else self._lag)
        if (far.sum(axis=1) > SILENT).sum() < ENOUGH:
            return
        loud = np.pad(far > 0.05 * far.max(axis=0), ((1, 1), (0, 0)))
        loud = loud[:-2] | loud[1:-1] | loud[2:]  # (HISTORY, COUNT); the clocks are not exact
        ratio = (self._near * loud).sum(axis=0) / ((far * loud).sum(axis=0) + SILENT)
        learnt = np.maximum(ratio if echoes else np.minimum(ratio, self._gains), self._gains / FALL)
        self._gains = np.where(loud.sum(axis=0) >= ENOUGH / 2, learnt, self._gains)

    def _best_lag(self) -> tuple[int, float]:
        # (LATEST + 1, COUNT, HISTORY), the latest lag first
        far = sliding_window_view(np.sqrt(self._far), HISTORY, axis=0)
        scores = similarity(far[:0:-1], np.sqrt(self._near).T)  # (LATEST,) by lag
        best = int(np.argmax(scores))
        return best, float(scores[best])

    def _lagged(self, lag: int) -> np.ndarray:
        """(HISTORY, COUNT) what was said `lag` frames before what the microphone heard."""
        return self._far[LATEST - lag :][:HISTORY]


def similarity(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Normalised correlation (…) of envelopes (…, COUNT, frames) with one (COUNT, frames).

    The mean of each band is subtracted first.
    """
    a, b = a - a.mean(axis=-1, keepdims=True), b - b.mean(axis=-1, keepdims=True)
    product = np.sqrt(np.einsum("...cf,...cf", a, a) * (b**2).sum())
    return np.einsum("...cf,cf", a, b) / np.where(product > 0, product, np.inf)
