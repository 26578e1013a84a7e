from ico3d.creating.looking.advice import Advice, spans_of, when


def test_moments_that_lie_close_are_one_span():
    assert spans_of([7.5, 1.0, 1.5, 2.0, 7.0], 0.6) == ((1.0, 2.0), (7.0, 7.5))
    assert spans_of([], 1.0) == ()


def test_seconds_are_told_before_the_text():
    advice = Advice("blur", "better", "it is blurred.", ((3.1, 3.2), (7.0, 9.2)))
    assert str(advice) == "at 3 s and 7 to 9 s: it is blurred."
    assert str(Advice("blur", "better", "it is blurred.")) == "it is blurred."


def test_of_many_spans_the_first_are_told():
    assert when([(i, i) for i in range(6)]) == "at 0 s, 1 s, 2 s, 3 s and 2 more times"
    assert when([(1, 1), (2, 2), (4, 6)]) == "at 1 s, 2 s and 4 to 6 s"
