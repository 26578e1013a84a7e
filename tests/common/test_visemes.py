import pytest

from ico3d.common.espeak.speech import synthesize
from ico3d.common.visemes import VISEMES, visemes


@pytest.mark.parametrize(
    ("symbol", "expected"),
    [
        ("", ("sil",)),
        ("p", ("PP",)),
        ("ˈɑː", ("aa",)),
        ("aɪ", ("aa", "ih")),
        ("ˌoʊ", ("oh", "ou")),
        ("tʃ", ("DD", "CH")),
        ("t͡s", ("DD", "SS")),
        ("v", ("FF",)),
        ("ʰ", ("sil",)),
        ("dʲ", ("DD", "ih")),
    ],
)
def test_shapes_of_a_sound(symbol, expected):
    assert visemes(symbol) == expected


@pytest.mark.parametrize("voice", ["en-us", "de", "fr", "es", "it", "pl", "sv", "tr", "hu"])
def test_every_phoneme_of_a_language_has_a_shape(voice):
    pytest.importorskip("espeakng_loader")
    text = "The big brown fox jumped over a lazy dog, yes; which children enjoy singing? Zoo!"
    sounds = [event.symbol for event in synthesize(text, voice).events if event.symbol]
    assert len(sounds) > 30
    for symbol in sounds:
        assert visemes(symbol) != ("sil",), symbol
        assert set(visemes(symbol)) <= set(VISEMES)
