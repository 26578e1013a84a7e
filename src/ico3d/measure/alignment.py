"""Forced alignment by pocketsphinx: the time of each speech sound in a recording."""

import os
import re
from pathlib import Path

import numpy as np

from ico3d.common.espeak.speech import Phoneme
from ico3d.common.files import read_small
from ico3d.errors import MissingExtraError, SettingsError

_IPA = (
    "AA ɑ AE æ AH ʌ AO ɔ AW aʊ AY aɪ EH ɛ ER ɚ EY eɪ IH ɪ IY i OW oʊ OY ɔɪ UH ʊ UW u B b CH tʃ "
    "D d DH ð F f G ɡ HH h JH dʒ K k L l M m N n NG ŋ P p R ɹ S s SH ʃ T t TH θ V v W w Y j Z z "
    "ZH ʒ"
)
_SYMBOLS = dict(zip(_IPA.split()[::2], _IPA.split()[1::2], strict=True))
MOST_README = 1 << 20
"""Bytes of the table of a folder's recordings; its cells take fifty times as much."""
_STEP = 100  # of the aligner's times per second


def transcripts(folder: Path) -> dict[Path, str]:
    """The recordings of a folder, and the words that are spoken in each.

    Args:
        folder: WAV files (mono, 16 kHz, PCM16) and a README.md with a table whose first column
            names a file and which has a column `words`.

    Raises:
        SettingsError: If there is no such table, or a file of the table is missing.
    """
    try:
        lines = read_small(folder / "README.md", most=MOST_README).decode("utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        raise SettingsError(f"{folder} has no README.md that says what is said.") from None
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "|" in line]
    head = next((row for row in rows if "words" in row), None)
    if head is None:
        raise SettingsError(f"{folder / 'README.md'} has no table with a column 'words'.")
    column = head.index("words")
    rows = [row for row in rows if len(row) > column and os.path.isfile(folder / row[0])]
    if not rows:
        raise SettingsError(f"{folder} has none of the files that its README.md lists.")
    return {folder / row[0]: row[column] for row in rows}


def aligned(samples: np.ndarray, words: str) -> tuple[list[Phoneme], float]:
    """Finds the times of the sounds of known words.

    Args:
        samples: (S,) int16 at 16 kHz.
        words: The spoken words, in English.

    Returns:
        The phonemes in order of time, and the end of the last one in seconds.

    Raises:
        MissingExtraError: If pocketsphinx is not installed.
        SettingsError: If the words cannot be aligned with the sound.
    """
    try:
        from pocketsphinx import Decoder
    except ImportError:
        raise MissingExtraError("pocketsphinx", "chat", "forced alignment") from None
    said = " ".join(re.findall(r"[a-z']+", words.lower()))
    decoder = Decoder(loglevel="FATAL", bestpath=False)
    try:
        decoder.set_align_text(said)
        for _ in range(2):  # words, then the phones inside them
            decoder.start_utt()
            decoder.process_raw(samples.tobytes(), full_utt=True)
            decoder.end_utt()
            phones = [phone for word in decoder.get_alignment() or () for phone in word]
            decoder.set_alignment()
    except RuntimeError:
        raise SettingsError(f"these words cannot be found in the sound: {said}.") from None
    phonemes = [Phoneme(phone.start / _STEP, _SYMBOLS.get(phone.name, "")) for phone in phones]
    return phonemes, (phones[-1].start + phones[-1].duration) / _STEP
