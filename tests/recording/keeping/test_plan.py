"""The texts: each language's have all of its speech sounds, as espeak-ng says."""

import pytest

from ico3d.chat.services.voice.espeak import NAMES
from ico3d.common.espeak.speech import synthesize
from ico3d.recording.keeping.plan import ALL_IDS, part_ids, scripts
from support.needs import needs

LANGUAGES = ("en", "de", "fr", "es", "zh", "ja")
FEWEST = {"en": 40, "de": 40, "fr": 34, "es": 30, "zh": 40, "ja": 25}
"""Speech sounds that each language has at least, so that no list is short."""


def test_there_are_texts_in_all_languages_of_the_page():
    assert tuple(scripts()) == LANGUAGES
    for language, script in scripts().items():
        assert set(part_ids(language)) < ALL_IDS
        assert "{name}" in script.consent and script.aloud
        assert len(set(script.sounds)) == len(script.sounds) >= FEWEST[language]
        assert set().union(*script.heard) == set(script.sounds)


@needs("espeakng_loader")
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_texts_have_the_sounds_that_are_stated(language):
    script = scripts()[language]
    for reading, stated in zip(script.texts, script.heard, strict=True):
        spoken = synthesize(reading.spoken, NAMES.get(language, language))
        heard = {event.symbol.translate(dict.fromkeys(map(ord, "ˈˌː"))) for event in spoken.events}
        assert set(stated) == heard & set(script.sounds), reading.text
