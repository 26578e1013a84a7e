"""Maps phonemes in IPA to mouth shapes: the fifteen Oculus visemes."""

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
"""Names of the Oculus visemes; the first one is silence."""

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
    """The mouth shapes of one phoneme, in the order in which the mouth takes them.

    Stress, length and other marks are ignored. A diphthong or affricate has two shapes: aɪ gives
    aa, ih; tʃ gives DD, CH.

    Args:
        symbol: IPA; the empty string stands for a pause.

    Returns:
        At least one name of `VISEMES`; an unknown symbol gives silence.
    """
    found: list[str] = []
    for sound in symbol:
        viseme = _VISEME_OF.get(sound)
        if viseme and (not found or found[-1] != viseme):
            found.append(viseme)
    return tuple(found) or ("sil",)
