"""What a manifest says of people: newer entries, older bundles, consent."""

import json
from dataclasses import replace

import pytest

from ico3d.bundle.format import Bundle
from ico3d.bundle.manifest import Manifest
from ico3d.bundle.packaged import FILE
from ico3d.bundle.people.provenance import Part, Provenance, check_consent
from ico3d.errors import BundleError
from support.bundles.random_bundle import random_head, random_manifest

FULL = Provenance("portrait", ("me.mp4",), "agreed", "CC0-1.0", "Ada", "Bob", "2026-11-24")


def stored(provenance: Provenance) -> dict:
    manifest = replace(random_manifest(random_head(10)), provenance=provenance)
    data = manifest.to_json()
    assert Manifest.from_json(data) == manifest
    return json.loads(data)["provenance"]


def test_everything_is_carried():
    assert stored(FULL) == {
        "kind": "portrait",
        "sources": ["me.mp4"],
        "consent": "agreed",
        "licence": "CC0-1.0",
        "likeness": "Ada",
        "made_by": "Bob",
        "made_on": "2026-11-24",
    }


def test_what_comes_from_whom_is_carried():
    parts = (Part("head", "portrait", "Ada"), Part("body", "synthetic", "nobody"))
    assert stored(replace(FULL, parts=parts))["parts"] == [
        {"name": "head", "kind": "portrait", "likeness": "Ada"},
        {"name": "body", "kind": "synthetic", "likeness": "nobody"},
    ]


def test_how_a_body_was_changed_is_carried_and_else_not_written():
    body = Part("body", "synthetic", "nobody", "sturdy", "")
    assert stored(replace(FULL, parts=(body,)))["parts"] == [
        {"name": "body", "kind": "synthetic", "likeness": "nobody", "build": "sturdy"}
    ]


@pytest.mark.parametrize("part", [None, [], {"name": "body"}, {"build": 3}, {"height": "tall"}])
def test_parts_that_make_no_sense_are_refused(part):
    manifest = json.loads(random_manifest(random_head(10)).to_json())
    if part and "name" not in part:
        part = {"name": "body", "kind": "synthetic", "likeness": "nobody"} | part
    told = manifest["provenance"] | {"parts": [part]}
    with pytest.raises(BundleError, match=r"manifest\.json\.provenance\.parts"):
        Manifest.from_json(json.dumps(manifest | {"provenance": told}).encode())


def test_what_is_not_stated_is_not_written_so_that_older_programs_can_read_it():
    older = Provenance("portrait", ("me.mp4",), "agreed", "CC0-1.0")
    assert set(stored(older)) == {"kind", "sources", "consent", "licence"}
    assert (older.likeness, older.made_by, older.made_on) == ("not stated",) * 3


@pytest.mark.parametrize("value", [[], {"kind": "a"}, {"likeness": 3}, {"who": "Ada"}])
def test_what_makes_no_sense_is_refused(value):
    manifest = json.loads(random_manifest(random_head(10)).to_json())
    if isinstance(value, dict) and "kind" not in value:
        value = manifest["provenance"] | value
    with pytest.raises(BundleError, match=r"manifest\.json\.provenance"):
        Manifest.from_json(json.dumps(manifest | {"provenance": value}).encode())


@pytest.mark.parametrize("consent", ["", "not stated", " ", "agreed; not stated"])
def test_without_consent_nobody_is_shown(consent):
    silent = replace(FULL, consent=consent)
    with pytest.raises(BundleError) as refused:
        check_consent(silent, "me.ico3d")
    assert str(refused.value) == (
        "me.ico3d does not say that the person it shows agreed to it: bake it again with "
        "--consent, or, if you know that they agreed, serve it with --without-consent."
    )
    check_consent(replace(silent, kind="synthetic"), "me.ico3d")
    check_consent(FULL, "me.ico3d")


def test_the_packaged_person_is_nobodys_likeness():
    assert Bundle.open(FILE).manifest.provenance.is_synthetic
