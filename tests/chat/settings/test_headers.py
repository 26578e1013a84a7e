"""Headers whose values are in the environment: what may be written, and where it may go."""

import pytest

from ico3d.chat.settings.headers import blanked, check_headers, filled_in
from ico3d.errors import SettingsError

WHERE = "chat settings: tool 'weather'"
AWAY, HERE = "https://api.example.org/x", "http://127.0.0.1:9000/x"
BEARER = {"Authorization": "Bearer $KEY", "X-Price": "$$5", "X-Both": "${KEY}-a"}


def test_variables_are_looked_up_when_they_are_needed(monkeypatch):
    check_headers(AWAY, BEARER, WHERE)
    check_headers(HERE, BEARER, WHERE)
    with pytest.raises(SettingsError, match="'weather' needs KEY in the environment"):
        filled_in(BEARER, WHERE)
    monkeypatch.setenv("KEY", "k" * 9)
    filled = {"Authorization": f"Bearer {'k' * 9}", "X-Price": "$5", "X-Both": f"{'k' * 9}-a"}
    assert filled_in(BEARER, WHERE) == filled
    assert blanked(f'{{"error": "no {"k" * 9}"}}', BEARER, WHERE) == '{"error": "no …"}'


@pytest.mark.parametrize(
    ("url", "headers", "message"),
    [
        (AWAY, {"X-Key": "$"}, "write $NAME"),
        (AWAY, {"X-Key": "$1"}, "write $NAME"),
        (AWAY, {"X Key": "a"}, "no name of a header"),
        (AWAY, {"X-Key\r\nHost": "a"}, "no name of a header"),
        (AWAY, {"": "a"}, "no name of a header"),
        ("http://api.example.org/x", {"X-Key": "$KEY"}, "unencrypted to api.example.org"),
    ],
)
def test_what_cannot_be_sent_is_one_sentence(url, headers, message):
    with pytest.raises(SettingsError) as error:
        check_headers(url, headers, WHERE)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_plain_headers_go_anywhere():
    check_headers("http://api.example.org/x", {"Accept-Language": "de"}, WHERE)


@pytest.mark.parametrize("value", ["two\r\nlines", "tab\t", "schlüssel"])
def test_a_value_cannot_bring_headers_of_its_own(monkeypatch, value):
    monkeypatch.setenv("KEY", value)
    with pytest.raises(SettingsError, match="more than plain text") as error:
        filled_in(BEARER, WHERE)
    assert value not in str(error.value)


def test_short_values_blank_no_words(monkeypatch):
    monkeypatch.setenv("KEY", "a")
    assert blanked("a cat", BEARER, WHERE) == "a cat"
