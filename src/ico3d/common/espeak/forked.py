"""Answers in processes that are copied from one that is ready, where libraries start slowly."""

import multiprocessing
import os
import resource
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from ico3d.common.native.isolated import LostError, RefusedError, Told

Answer = Callable[[dict[str, Any]], Told]


def forked(answer: Answer, seconds: int) -> Answer:
    """An answer that is worked out in a copy of this process, which a text may end.

    The next request needs no more than another copy, which takes milliseconds: whoever has many
    texts that end the library keeps nobody waiting.

    Args:
        answer: Answers a request; what it raises refuses it.
        seconds: Processor time that a request may take.
    """
    context = multiprocessing.get_context("fork")

    def answered(request: dict[str, Any]) -> Told:
        here, there = context.Pipe(duplex=False)
        copy = context.Process(target=_tell, args=(answer, request, seconds, there))
        copy.start()
        there.close()
        try:
            error, told = here.recv()
        except EOFError:
            raise LostError from None
        finally:
            here.close()
            copy.join()
        if error:
            raise RefusedError(error)
        return told

    return answered


def _tell(answer: Answer, request: dict[str, Any], seconds: int, there: Connection) -> None:
    for pipe in (0, 1):  # whoever asked sees the end of the first process, not of this copy
        os.close(pipe)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    try:
        told: tuple[str, Told] = ("", answer(request))
    except Exception as error:
        told = (str(error), ({}, b""))
    there.send(told)
    there.close()
    os._exit(0)
