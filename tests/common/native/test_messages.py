"""Messages of libraries in C++."""

import os

import pytest

from ico3d.common.native.messages import held_back


def test_they_are_not_shown(capfd):
    """Nor is what is printed afterwards lost."""
    with held_back():
        os.write(2, b"W0000 nobody needs this\n")
    os.write(2, b"but this\n")
    assert capfd.readouterr().err == "but this\n"


def test_they_are_shown_where_something_fails(capfd):
    """The reason may be among them."""
    with pytest.raises(RuntimeError), held_back():
        os.write(2, b"E0000 no such file\n")
        raise RuntimeError
    assert capfd.readouterr().err == "E0000 no such file\n"


def test_no_file_stays_open():
    before = len(os.listdir("/dev/fd"))
    for _ in range(3):
        with held_back():
            pass
    assert len(os.listdir("/dev/fd")) == before
