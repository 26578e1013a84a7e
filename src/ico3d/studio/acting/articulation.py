"""From phonemes to blendshapes of the mouth: visemes, coarticulation, closed lips."""

from collections.abc import Sequence

import numpy as np

from ico3d.common.espeak.speech import Phoneme

STEP = 0.005
"""Seconds between the rows that are computed; frames are interpolated between them."""
SPREAD = 0.034
"""Standard deviation in seconds of the window over which neighbouring sounds blend."""
CLOSING = 0.05
"""Seconds in which lips close before p, b and m, and open afterwards."""
LEAST_CLOSED = 0.045
"""Least time in seconds for which lips stay closed: longer than a frame at 25 per second."""

BILABIALS = frozenset("pbm")
SILENCE = "sil"

VISEMES_OF = {
    **{key: {"aa": 1.0} for key in "aɑɒ"},
    **{key: {"aa": 0.7} for key in "ʌɐ"},
    "æ": {"aa": 0.65, "E": 0.45},
    "ə": {"E": 0.35, "aa": 0.15},
    **{key: {"E": 1.0} for key in "ɛe"},
    **{key: {"E": 0.4, "RR": 0.5} for key in "ɜɚɝ"},
    **{key: {"ih": 1.0} for key in "ɪi"},
    "j": {"ih": 0.8},
    **{key: {"oh": 1.0} for key in "ɔo"},
    **{key: {"ou": 1.0} for key in "ʊu"},
    "w": {"ou": 1.0},
    **{key: {"RR": 1.0} for key in "ɹr"},
    **{key: {"PP": 1.0} for key in "pbm"},
    **{key: {"FF": 1.0} for key in "fv"},
    **{key: {"TH": 1.0} for key in "θð"},
    **{key: {"DD": 1.0} for key in "td"},
    **{key: {"nn": 1.0} for key in "nlɾ"},
    **{key: {"kk": 1.0} for key in "kɡgŋx"},
    **{key: {"SS": 1.0} for key in "sz"},
    **{key: {"CH": 1.0} for key in "ʃʒ"},
}
"""Visemes that each IPA letter mixes; missing letters take the shape of their neighbours."""

STRENGTH = {"PP": 4.0, "FF": 3.0, "CH": 2.0, "ou": 1.6, "oh": 1.2, "SS": 1.2, "TH": 1.0}
STRENGTH |= dict.fromkeys(("aa", "E", "ih", "sil"), 1.0) | {"RR": 0.9}
STRENGTH |= dict.fromkeys(("DD", "kk", "nn"), 0.6)
"""How firmly a viseme holds its shape against its neighbours (dominance)."""
UNKNOWN_STRENGTH = 0.05

STRESSED, UNSTRESSED = 1.25, 0.9


def articulate(
    phonemes: Sequence[Phoneme], end: float, visemes: dict[str, np.ndarray], times: np.ndarray
) -> np.ndarray:
    """Blendshape weights of the mouth at given times.

    Each phoneme has a viseme as its target. Neighbouring phonemes blend under a symmetric window,
    weighted by dominance, so that lips move neither early nor late. At p, b and m the lips close
    whatever the neighbours are.

    Args:
        phonemes: Phonemes in order of time.
        end: Time in seconds at which the last phoneme ends.
        visemes: (K,) blendshape weights by name of the viseme.
        times: (F,) seconds.

    Returns:
        (F, K) float32 weights.
    """
    count = int(np.ceil(max(end, float(times.max(initial=0.0))) / STEP)) + 1
    wanted, strength = _wanted(phonemes, end, visemes, count)
    window = np.exp(-0.5 * (np.arange(-30, 31) * STEP / SPREAD) ** 2)
    blended = _smooth(wanted * strength[:, None], window)
    blended /= _smooth(strength[:, None], window)  # (count, K)
    closed = closure(phonemes, end, np.arange(count) * STEP)[:, None]
    blended = (1 - closed) * blended + closed * visemes["PP"]
    grid = np.arange(count) * STEP
    columns = [np.interp(times, grid, column) for column in blended.T]
    return np.stack(columns, axis=1).astype(np.float32)  # (F, K)


def closure(phonemes: Sequence[Phoneme], end: float, times: np.ndarray) -> np.ndarray:
    """(F,) how far p, b and m close the lips at times (F,) in seconds: 1 while fully closed."""
    closed = np.zeros(len(times))
    for first, last, symbol in _segments(phonemes, end):
        if symbol.strip("ˈˌː")[:1] not in BILABIALS:
            continue
        shut = last if "m" in symbol else first + 0.6 * (last - first)
        shut = max(shut - 0.01, first + LEAST_CLOSED)
        away = np.maximum(np.maximum(first - times, times - shut), 0) / CLOSING
        part = np.clip(1 - away, 0, 1)
        closed = np.maximum(closed, part * part * (3 - 2 * part))
    return closed


def _segments(phonemes: Sequence[Phoneme], end: float) -> list[tuple[float, float, str]]:
    """(start, end, symbol) of each phoneme."""
    starts = [p.time for p in phonemes] + [end]
    return [(starts[i], starts[i + 1], p.symbol) for i, p in enumerate(phonemes)]


def _wanted(
    phonemes: Sequence[Phoneme], end: float, visemes: dict[str, np.ndarray], count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Wanted weights (count, K) and their strength (count,) on the fine grid of times."""
    wanted = np.tile(visemes[SILENCE].astype(float), (count, 1))
    strength = np.full(count, STRENGTH[SILENCE])
    for first, last, symbol in _segments(phonemes, end):
        parts = _parts(symbol)
        for index, mix in enumerate(parts):
            begin = round((first + (last - first) * index / len(parts)) / STEP)
            finish = round((first + (last - first) * (index + 1) / len(parts)) / STEP)
            shape = sum((w * visemes[v].astype(float) for v, w in mix.items()), np.zeros(1))
            wanted[begin:finish] = shape * _emphasis(symbol, mix)
            strength[begin:finish] = max((STRENGTH[v] for v in mix), default=UNKNOWN_STRENGTH)
    return wanted, strength


def _parts(symbol: str) -> list[dict[str, float]]:
    """The viseme mixes that a symbol goes through: two for a diphthong, `sil` for a pause."""
    letters = [c for c in symbol if c in VISEMES_OF]
    if symbol.strip("ˈˌː").startswith(("tʃ", "dʒ")):
        letters = letters[1:]
    if not letters:
        return [{}] if symbol.strip("ˈˌː_:") else [{SILENCE: 1.0}]
    return [VISEMES_OF[c] for c in letters]


def _emphasis(symbol: str, mix: dict[str, float]) -> float:
    """Stressed vowels open wider than unstressed ones; consonants keep their shape."""
    if not set(mix) & {"aa", "E", "ih", "oh", "ou"}:
        return 1.0
    return STRESSED if symbol[:1] in "ˈˌ" and symbol else UNSTRESSED


def _smooth(rows: np.ndarray, window: np.ndarray) -> np.ndarray:
    """(N, K) rows averaged under a window along N, the ends held."""
    half = len(window) // 2
    padded = np.pad(rows, ((half, half), (0, 0)), mode="edge")
    kernel = window / window.sum()
    return np.stack([np.convolve(c, kernel, mode="valid") for c in padded.T], axis=1)
