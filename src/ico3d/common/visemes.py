"""Which mouth shape a speech sound has: IPA symbols to the fifteen Oculus visemes."""

VISEMES = (
    "sil",
    "PP",
    "FF",
    "TH",
    "DD",
    "kk",
    "CH",
    "SS",
    "nn",
    "RR",
    "aa",
    "E",
    "ih",
    "oh",
    "ou",
)
"""Oculus viseme names; silence is the first."""

_SOUNDS = {
    "PP": "pbmɓʙɸβ",
    "FF": "fvɱʋⱱ",
    "TH": "θð",
    "DD": "tdʈɖɗ",
    "kk": "kɡgŋqɢcɟxɣχçʝhɦħʔɲɴ",
    "CH": "ʃʒɕʑʂʐ",
    "SS": "sz",
    "nn": "nlɫɭɬɮʎɳ",
    "RR": "rɹɾʁʀɻɽɚɜ",
    "aa": "aɑɐäɶʌA",
    "E": "eɛæəɘεœøɞ",
    "ih": "iɪjʲɨᵻɯ",
    "oh": "oɔɒɵɤ",
    "ou": "uʊwʍyʏʉɥ",
}
_VISEME_OF = {sound: viseme for viseme, sounds in _SOUNDS.items() for sound in sounds}


def visemes(symbol: str) -> tuple[str, ...]:
    """The mouth shapes of one phoneme, in the order in which they are passed through.

    Stress, length and other marks are ignored; a diphthong or affricate has two shapes
    (aɪ: aa, ih; tʃ: DD, CH).

    Args:
        symbol: IPA; the empty string is a pause.

    Returns:
        Names from `VISEMES`, at least one; unknown symbols count as silence.
    """
    found: list[str] = []
    for sound in symbol:
        viseme = _VISEME_OF.get(sound)
        if viseme and (not found or found[-1] != viseme):
            found.append(viseme)
    return tuple(found) or ("sil",)
