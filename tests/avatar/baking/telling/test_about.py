"""What a bundle has to say of the person it shows."""

import re
from datetime import UTC, datetime
from pathlib import Path

import pytest

from ico3d.avatar.baking.telling.about import provenance_of
from ico3d.avatar.baking.telling.statement import Statement
from ico3d.cli import main
from ico3d.errors import BundleError, SettingsError

OUT = Path("me.ico3d")
RECORDED = {
    "kind": "portrait",
    "sources": ["me.mp4"],
    "likeness": "Ada",
    "consent": "agreed in writing",
    "licence": "CC0-1.0",
}
UNSAID = RECORDED | dict.fromkeys(("likeness", "consent", "licence"), "not stated")


def test_what_recordings_state_is_carried_with_the_maker_and_the_day():
    found = provenance_of({"it": RECORDED}, Statement(made_by="Bob"), OUT)
    assert (found.kind, found.sources) == ("portrait", ("me.mp4",))
    said = found.likeness, found.consent, found.licence, found.made_by
    assert said == ("Ada", "agreed in writing", "CC0-1.0", "Bob")
    assert found.made_on == datetime.now(UTC).date().isoformat()


def test_what_is_said_anew_takes_its_place():
    found = provenance_of({"it": RECORDED}, Statement("Eve", "on film", "private", "Bob"), OUT)
    assert (found.likeness, found.consent, found.licence) == ("Eve", "on film", "private")


def test_what_nobody_says_is_asked_for_in_one_sentence():
    with pytest.raises(SettingsError) as refused:
        provenance_of({"it": UNSAID}, Statement(), OUT)
    assert str(refused.value) == (
        "me.ico3d would show a person, and has to say whose likeness it is (--likeness), what "
        "that person agreed to, and how (--consent), under which licence it may be used "
        "(--licence) and who makes it (--made-by)."
    )
    with pytest.raises(SettingsError, match=r"has to say who makes it \(--made-by\)\.$"):
        provenance_of({"it": RECORDED}, Statement(), OUT)


def test_recordings_of_one_person_must_all_state_it():
    """Somebody who agreed to be filmed for a head has not agreed to another film."""
    other = RECORDED | {"kind": "multiview", "sources": ["hall"], "licence": "private"}
    both = provenance_of({"head": RECORDED, "body": other}, Statement(made_by="Bob"), OUT)
    assert (both.kind, both.sources) == ("portrait, multiview", ("me.mp4", "hall"))
    assert (both.likeness, both.licence) == ("Ada", "CC0-1.0; private")
    silent = other | {"consent": "not stated"}
    with pytest.raises(SettingsError, match=r"say what that person agreed to, and how \(--cons"):
        provenance_of({"head": RECORDED, "body": silent}, Statement(made_by="Bob"), OUT)


def test_nobody_has_to_agree_for_a_synthetic_person():
    about = UNSAID | {"kind": "synthetic"}
    assert provenance_of({"it": about}, Statement(), OUT).has_consent
    del about["likeness"]  # as models of earlier versions say it
    assert provenance_of({"it": about}, Statement(), OUT).likeness.startswith("nobody")
    with pytest.raises(SettingsError, match="whose likeness"):
        provenance_of({"head": about, "body": UNSAID}, Statement(), OUT)


def test_a_recording_must_say_what_it_is():
    with pytest.raises(BundleError, match=r"the head's recording: its provenance lacks 'kind'\."):
        provenance_of({"the head's recording": {}}, Statement(), OUT)


def test_bake_explains_what_it_asks_for(capsys):
    with pytest.raises(SystemExit):
        main(["bake", "--help"])
    shown = " ".join(re.sub("[│╭╮╰╯─]", " ", capsys.readouterr().out).split())
    for option in ("--likeness STR", "--consent STR", "--licence STR", "--made-by STR"):
        assert option in shown
