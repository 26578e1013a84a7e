"""Speech sounds in time, from voices that say how long each of their symbols lasts."""

import unicodedata
from collections.abc import Iterable

from ico3d.common.espeak.speech import Phoneme

STRESSES = "ˈˌ"  # stand before the sound that they belong to
PAUSE = ""


def timed(symbols: Iterable[tuple[str, float]]) -> tuple[Phoneme, ...]:
    """The speech sounds that a voice's symbols mean.

    A mark of stress belongs to the sound after it; a mark of length, a diacritic or a space belongs
    to the sound before it. Punctuation marks are pauses.

    Args:
        symbols: IPA symbols, marks and punctuation in their order, and how long each lasts in
            seconds.
    """
    found: list[Phoneme] = []
    now, stress, since = 0.0, "", 0.0
    for symbol, seconds in symbols:
        if symbol in STRESSES:
            stress, since = stress + symbol, since if stress else now
        elif _is_sound(symbol):
            found.append(Phoneme(since if stress else now, stress + symbol))
            stress = ""
        elif symbol.isspace() or _is_mark(symbol):
            if found and _is_mark(symbol):
                found[-1] = Phoneme(found[-1].time, found[-1].symbol + symbol)
        elif not found or found[-1].symbol != PAUSE:
            found.append(Phoneme(now, PAUSE))
        now += seconds
    return tuple(found)


def _is_sound(symbol: str) -> bool:
    return unicodedata.category(symbol[0]) in ("Ll", "Lu", "Lo")


def _is_mark(symbol: str) -> bool:
    return unicodedata.category(symbol[0]) in ("Lm", "Mn")
