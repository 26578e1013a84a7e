"""Whose likeness a head on the body of another is, and who agreed."""

from dataclasses import replace

import pytest

from ico3d.avatar.embodying.telling import told_together
from ico3d.bundle.people.provenance import OPENVOICE, ClonedVoice, Provenance

ADA = Provenance("portrait", ("ada.mp4",), "Ada agreed", "ours", "Ada", "Bob", "2026-11-24")
EVE = Provenance("multiview", ("eve",), "Eve agreed", "ours", "Eve")
NOBODY = Provenance("synthetic", ("cc0",), "not needed", "CC0", "nobody", "us")


def test_two_people_both_count():
    told = told_together(ADA, EVE)
    assert (told.likeness, told.consent, told.licence) == (
        "Ada; Eve",
        "Ada agreed; Eve agreed",
        "ours",
    )
    assert (told.made_by, told.made_on) == ("Bob", "2026-11-24")


@pytest.mark.parametrize("other", [EVE, NOBODY])
def test_who_did_not_agree_is_not_covered_by_another(other):
    silent = replace(ADA, consent="not stated")
    assert not told_together(silent, other).has_consent
    assert not told_together(other, silent).has_consent


def test_nobody_on_nobody_is_nobody():
    told = told_together(NOBODY, replace(NOBODY, sources=("cc0", "mit")))
    assert told.is_synthetic and told.sources == ("cc0", "mit") and told.made_by == "us"


def test_a_voice_is_that_of_the_head():
    voice, other = (ClonedVoice(OPENVOICE, name, "agreed") for name in ("ada.mp4", "eve.mp4"))
    told = told_together(replace(ADA, voice=voice), replace(EVE, voice=other))
    assert told.voice == voice
    assert told_together(ADA, replace(EVE, voice=other)).voice is None
