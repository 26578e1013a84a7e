"""The search for the number of visitors, with servers that bear a known number."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.measure.talking.crowd_search import AHEAD, Trial, most_borne, search


def bearing(limit: int):
    """A server on which pieces are late from one visitor more than its limit on."""
    return lambda visitors: Trial(visitors, visitors, AHEAD if visitors <= limit else AHEAD - 1)


@given(st.integers(0, 120))
def test_the_number_is_found_within_a_tenth_and_never_exceeded(limit):
    trials = search(bearing(limit), most=100)
    found, limit = most_borne(trials), min(limit, 100)
    assert found <= limit <= found + max(1, 0.1 * found)
    assert len(trials) <= 9


def test_numbers_double_until_they_are_too_many():
    tried = [trial.visitors for trial in search(bearing(33), most=100)]
    assert tried == [10, 20, 40, 30, 35, 32]
    assert [trial.visitors for trial in search(bearing(200), most=100)] == [10, 20, 40, 80, 100]


@pytest.mark.parametrize(
    ("own", "ahead", "borne", "told"),
    [
        (10, 150.0, True, "the latest piece 150 ms"),
        (10, 149.0, False, "the latest piece 149 ms"),
        (9, 300.0, False, "9 heard their own voice"),
        (0, None, False, "somebody got no answer"),
    ],
)
def test_who_gets_no_answer_or_another_voice_is_too_many(own, ahead, borne, told):
    trial = Trial(10, own, ahead)
    assert trial.borne == borne and told in trial.told
