"""Answers that are worked out in copies of a process."""

import os
import signal

import pytest

from ico3d.common.espeak.forked import forked
from ico3d.common.native.isolated import LostError, RefusedError

SCRIPT = {
    "answer": lambda: ({"process": os.getpid()}, b"sound"),
    "refuse": lambda: 1 / 0,
    "abort": os.abort,
    "kill": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "print": lambda: os.write(1, b"spoils an answer"),
}


def endless():
    while True:
        pass


@pytest.fixture
def ask():
    script = SCRIPT | {"spin": endless}
    return forked(lambda request: script[request["do"]](), 1)


def test_each_answer_has_a_process_of_its_own(ask):
    (first, sound), (second, _) = ask({"do": "answer"}), ask({"do": "answer"})
    assert len({os.getpid(), first["process"], second["process"]}) == 3
    assert sound == b"sound"


def test_what_refuses_is_told(ask):
    with pytest.raises(RefusedError, match="division by zero"):
        ask({"do": "refuse"})


@pytest.mark.parametrize("way", ["abort", "kill", "spin"])
def test_a_copy_that_ends_is_lost_and_the_next_one_answers(way, ask):
    with pytest.raises(LostError):
        ask({"do": way})
    assert ask({"do": "answer"})[1] == b"sound"


def test_a_copy_cannot_write_where_the_process_answers(ask, capfd):
    with pytest.raises(RefusedError, match="Bad file descriptor"):
        ask({"do": "print"})
    assert capfd.readouterr().out == ""
