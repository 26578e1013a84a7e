"""What synthetic voices read aloud for a head that is baked without its recording."""

import pytest

from ico3d.avatar.baking.persona import load_persona, spoken_texts
from ico3d.bundle.format import Bundle
from ico3d.bundle.packaged import FILE
from ico3d.bundle.persona import Persona


def test_answers_and_facts_are_spoken_but_no_questions():
    persona = Persona("Ada", notes=("who are you | your name => I am Ada.", " Ada likes tea. "))
    assert spoken_texts(persona) == ["I am Ada.", "Ada likes tea."]


def test_somebody_without_notes_says_what_the_packages_persona_says():
    own = load_persona(None)
    assert spoken_texts(Persona("Ada")) == spoken_texts(own)
    assert len(spoken_texts(own)) == len(own.notes) and all(spoken_texts(own))


def test_the_packages_person_says_that_she_speaks_english():
    assert load_persona(None).languages == ("en",)


@pytest.mark.skipif(not FILE.is_file(), reason="no packaged avatar")
def test_so_does_the_packaged_avatar():
    assert Bundle.open(FILE).manifest.persona.languages == ("en",)
