import time
import unicodedata

import pytest

from ico3d.bundle.persona import Persona, check_persona
from ico3d.chat.services.language.notes import Questions
from ico3d.common.people.spelling import spelled
from ico3d.common.people.stated import alike
from ico3d.recording.keeping.people import checked_name
from ico3d.recording.refusals import Refused

ACCENTS = "\u0315\u0300" * 20_000
"""Of one letter; Python's own normal form of them takes five seconds."""


@pytest.mark.parametrize("form", ["NFC", "NFKC"])
@pytest.mark.parametrize(
    "text", ["", " ", "Zoe\u0308  Ångström\n", "ﷺ ½ \u1100\u1161", "e\u0301" * 100]
)
def test_texts_of_people_have_pythons_normal_form(form, text):
    assert spelled(form, text) == unicodedata.normalize(form, text)


def _refused():
    with pytest.raises(Refused):
        checked_name("a" + ACCENTS)


NOTES = (f"who are you{ACCENTS[:3900]} => a",) * 25
READERS = {
    "a likeness": lambda: alike("a" + ACCENTS),
    "a name in the studio": _refused,
    "a persona": lambda: check_persona(Persona("x", notes=NOTES), "it"),
    "its notes": lambda: Questions(NOTES),
}


@pytest.mark.parametrize("what", READERS)
def test_a_letter_of_many_accents_takes_no_longer_than_other_texts(what):
    begin = time.process_time()
    READERS[what]()
    assert time.process_time() - begin < 0.7
