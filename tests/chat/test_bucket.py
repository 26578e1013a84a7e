"""A bucket fills again with time, up to what it holds."""

from ico3d.chat.bucket import Bucket


def test_what_was_taken_comes_back():
    now = 0.0
    bucket = Bucket(0.5, 2.0, lambda: now)
    assert [bucket.take(1) for _ in range(3)] == [True, True, False]
    bucket.drain(5)
    now = 2.0
    assert bucket.has(1) and not bucket.has(1.1)
    now = 60.0
    assert bucket.take(2) and not bucket.take(0.1)


def test_what_is_owed_takes_its_time():
    now = 0.0
    bucket = Bucket(2.0, 4.0, lambda: now)
    assert [bucket.owe(3), bucket.owe(1), bucket.owe(3)] == [0.0, 0.0, 1.5]
    now = 1.0
    assert bucket.owe(0) == 0.5 and not bucket.take(1)
    now = 60.0
    assert bucket.owe(0) == 0.0 and bucket.take(4)
