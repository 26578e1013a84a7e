"""Personas: in bundles old and new, and in files of their own."""

import json

import pytest

from ico3d.bundle.manifest import Manifest
from ico3d.bundle.persona import Persona, check_persona, read_persona
from ico3d.errors import BundleError

FILE = """
name = "Ada"
greeting = "Good evening."
manner = "Warm, with dry humour."
languages = ["en", "pt-BR"]
forbidden = ["politics | elections", "my age"]
suggestions = ["Who are you?"]
notes = ["who are you => I am Ada.", "The museum closes at six."]
[voice]
"espeak-ng" = "en+f2"
"""
ADA = Persona(
    "Ada",
    "Good evening.",
    ("who are you => I am Ada.", "The museum closes at six."),
    "Warm, with dry humour.",
    ("en", "pt-BR"),
    {"espeak-ng": "en+f2"},
    ("politics | elections", "my age"),
    ("Who are you?",),
)


def test_a_file_may_say_all_or_only_the_name(tmp_path):
    path = tmp_path / "ada.toml"
    path.write_text(FILE)
    assert read_persona(path) == ADA
    path.write_text('name = "Ada"')
    assert read_persona(path) == Persona("Ada")
    path = tmp_path / "ada.json"
    path.write_text('{"name": "Ada", "notes": ["a => b"]}')
    assert read_persona(path) == Persona("Ada", notes=("a => b",))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "Ada"', "", "lacks 'name'"),
        ('name = "Ada"', 'name = " "', "name must not be empty"),
        ('name = "Ada"', "name = 3", "name must be a text"),
        ('name = "Ada"', 'name = "Ada"\nage = 36', "unknown key 'age'"),
        ('"pt-BR"', '"Portuguese"', "not 'Portuguese'"),
        ('"my age"', '"my age | "', "topics such as"),
        ("=> I am Ada.", "=> ", "note 1 is neither"),
        ("who are you =>", "=>", "note 1 is neither"),
        ('"The museum closes at six."', '""', "note 2 is neither"),
        ('"en+f2"', "2", "must be a text"),
        ("Good evening.", "x" * 4001, "greeting must have at most 4000"),
        ("[voice]", "[voice", "not valid TOML"),
        ("[voice]", "a = " + "[" * 20_000, "not valid TOML"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(tmp_path, old, new, message):
    path = tmp_path / "ada.toml"
    assert old in FILE
    path.write_text(FILE.replace(old, new, 1))
    with pytest.raises(BundleError) as error:
        read_persona(path)
    assert message in str(error.value) and "\n" not in str(error.value)
    assert str(path) in str(error.value)


def test_a_missing_or_huge_file_is_one_sentence(tmp_path):
    with pytest.raises(BundleError, match="cannot be read"):
        read_persona(tmp_path / "nobody.toml")
    path = tmp_path / "huge.toml"
    path.write_text("#" * (2 << 20))
    with pytest.raises(BundleError, match="larger than"):
        read_persona(path)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"forbidden": ("|".join(["ab"] * 330_000),)}, "forbidden must have at most 4000"),
        ({"forbidden": ("|".join(["ab"] * 1300),)}, "forbidden must hold at most 1000 names"),
        ({"forbidden": ("b" * 101,)}, "of at most 100 letters"),
        ({"notes": ("ab |" * 240_000 + "=> c",)}, "notes must have at most 4000"),
        ({"notes": ("\ufdfa" * 223,)}, "notes must have at most 4000"),  # 18 letters each
        ({"notes": ("|".join(["ab"] * 1001) + "=> c",) * 10}, "notes must ask at most 10000"),
        ({"notes": ("b" * 4000,) * 126}, "has 504004 letters; at most 500000"),
        ({"voice": {"espeak-ng": "b" * 4001}}, "voice must have at most 4000"),
        *(
            ({"voice": {"espeak-ng": name}}, "voice must be names")
            for name in ("", "..", "../q", "/dev/zero", "en+../q", "!v/f3", "a\\b", "en+f2+f3")
        ),
        ({"suggestions": ("who?",) * 13}, "suggestions must be at most 12 questions"),
        ({"suggestions": ("b" * 101,)}, "questions of at most 100 letters"),
        ({"suggestions": (" ",)}, "suggestions must not be empty texts"),
    ],
)
def test_a_persona_has_as_much_text_as_people_write(given, message):
    with pytest.raises(BundleError, match=message):
        check_persona(Persona("Anna", **given), "anna")
    check_persona(Persona("Anna", notes=("b" * 4000,) * 100, forbidden=("old war",) * 100), "anna")


def test_what_is_proposed_is_what_the_first_notes_answer_or_what_the_persona_says():
    notes = ("A fact.", " | who are you| your name => Ada.", "=> Nobody asks.", "why|how => So.")
    notes += ("when => Now.", "where => Here.")
    assert Persona("Ada", notes=notes).proposed == ("who are you", "why", "when")
    assert Persona("Ada", notes=notes, suggestions=("Where?",)).proposed == ("Where?",)
    assert Persona("Ada").proposed == ()


def test_bundles_hold_what_a_persona_says_and_old_ones_stay_readable(packed):
    value = json.loads(packed)
    assert set(value["persona"]) == {"name", "greeting", "notes"}, "as programs before wrote it"
    assert Manifest.from_json(packed).to_json() == packed
    value["persona"] |= {"manner": "Warm.", "voice": {"kokoro": "af_heart"}}
    value["persona"]["languages"] = ["sr-Latn-RS", "es-419", "de-CH-1996", "sl-rozaj", "zh-yue-HK"]
    manifest = Manifest.from_json(json.dumps(value).encode())
    assert manifest.persona.manner == "Warm." and manifest.persona.forbidden == ()
    assert json.loads(manifest.to_json())["persona"] == value["persona"]
    odd = [("languages", [code]) for code in ("Klingon", "sr-RS-Latn", "en-", "x-private", "en-1")]
    for key, entry in [*odd, ("forbidden", ["|"]), ("mood", "happy")]:
        wrong = value | {"persona": value["persona"] | {key: entry}}
        with pytest.raises(BundleError, match=r"manifest\.json"):
            Manifest.from_json(json.dumps(wrong).encode())


@pytest.fixture
def packed(tmp_path):
    from ico3d.bundle.format import Bundle
    from support.bundles.random_bundle import write_random_bundle

    write_random_bundle(tmp_path / "a.ico3d")
    return Bundle.open(tmp_path / "a.ico3d").manifest.to_json()
