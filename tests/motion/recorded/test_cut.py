"""The text file of cuts: round trips, and what is refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.errors import SettingsError
from ico3d.motion.recorded.cut import Cut, from_toml, named, to_toml

FRAMES = 60


@st.composite
def cuts(draw) -> Cut:
    name = draw(st.from_regex(r"[a-z]{1,8}(_[a-z]{1,8}){0,2}", fullmatch=True))
    hands = draw(st.sampled_from(["left", "right", "both", "none"]))
    first, last = sorted(draw(st.lists(st.integers(0, 59), min_size=2, max_size=2, unique=True)))
    stroke, release = sorted(draw(st.lists(st.integers(first, last), min_size=2, max_size=2)))
    return Cut(name, hands, first, stroke, release, last)


@given(st.lists(cuts(), max_size=5), st.sampled_from([15.0, 29.97, 1e-3 + 24]))
def test_cuts_come_back(found, fps):
    text = to_toml(found, fps, FRAMES)
    assert from_toml(text.encode(), "clips.toml", fps, FRAMES) == tuple(found)


WAVE = Cut("wave", "right", 3, 10, 14, 20)
TEXT = to_toml([WAVE], 15.0, FRAMES)


@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        ("version = 1", "version = 2", "version must be 1"),
        ("fps = 15.0", "fps = 25.0", "of 60 frames at 25 per second, but this one has 60 at 15"),
        ('"wave"', '"Wave!"', r"clip\[0\]\.name must be small letters and '_', not 'Wave!'"),
        ('"wave"', '"wave_2"', "small letters"),
        ('"right"', '"foot"', r"clip\[0\]\.hands must be"),
        ("stroke = 10", "stroke = 15", r"first, stroke, release and last must ascend within 0 to"),
        ("last = 20", "last = 60", "must ascend within 0 to 59"),
        ("last = 20", "", r"clip\[0\] lacks 'last'"),
        ("last = 20", "last = 20\nspeed = 3", "unknown key 'speed'"),
        ("last = 20", "last = ", "is not valid TOML"),
        ("first = 3", "first = 3.5", "must be a whole number"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(before, after, sentence):
    assert before in TEXT
    with pytest.raises(SettingsError, match=sentence) as caught:
        from_toml(TEXT.replace(before, after).encode(), "clips.toml", 15.0, FRAMES)
    assert "\n" not in str(caught.value) and str(caught.value).startswith("clips.toml")


def test_an_edited_file_may_have_no_clips_at_all():
    text = TEXT.partition("[[clip]]")[0]
    assert from_toml(text.encode(), "clips.toml", 15.0, FRAMES) == ()


def test_cuts_of_one_name_are_numbered():
    names = [name for name, _ in named([WAVE, WAVE, Cut("nod", "none", 1, 2, 2, 5), WAVE])]
    assert names == ["wave", "wave_2", "nod", "wave_3"]
