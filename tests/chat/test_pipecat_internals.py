"""What is used of pipecat beyond its documented interface is in one module, and still there."""

import asyncio
import importlib
import inspect
import pkgutil
import re
from functools import cache

import pytest
from pipecat.frames.frames import (
    EndFrame,
    InterruptionFrame,
    LLMRunFrame,
    TextFrame,
    UserStartedSpeakingFrame,
)
from pipecat.pipeline.pipeline import Pipeline
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

import ico3d.chat
from ico3d.chat.pipecat_internals import OVERRIDDEN, TOUCHED, end_what_is_overtaken

pytestmark = pytest.mark.slow


def pipecat_class(where):
    module, _, name = where.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except ModuleNotFoundError as error:
        pytest.skip(f"{where} needs {error.name}")


@cache
def own_names(kind):
    """Private names that pipecat gives a class: its methods, and what its code sets on `self`."""
    bases = [base for base in kind.__mro__ if base.__module__.startswith("pipecat.")]
    source = "\n".join(inspect.getsource(base) for base in bases)
    methods = {name for base in bases for name in vars(base) if re.match(r"_[a-z]", name)}
    return methods | set(re.findall(r"self\.(__?[a-z]\w*)(?:: [^=\n]+)? = ", source))


@pytest.mark.parametrize(("where", "name"), TOUCHED)
def test_pipecat_still_has_what_is_touched(where, name):
    assert name in own_names(pipecat_class(where))


@pytest.mark.parametrize(("where", "name"), [(where, name) for where, name, _ in OVERRIDDEN])
def test_pipecat_still_calls_what_is_overridden(where, name):
    kind = pipecat_class(where)
    modules = [inspect.getmodule(base) for base in kind.__mro__ if "pipecat" in base.__module__]
    assert name in own_names(kind)
    assert any(f"self.{name}(" in inspect.getsource(module) for module in modules)


def test_nothing_else_is_touched():
    allowed = {name for _, name, _ in OVERRIDDEN}
    found = {}
    for info in pkgutil.walk_packages(ico3d.chat.__path__, "ico3d.chat."):
        if info.name.endswith("__main__"):
            continue
        module = importlib.import_module(info.name)
        for name, kind in inspect.getmembers(module, inspect.isclass):
            if kind.__module__ == info.name and own_bases(kind):
                known = set().union(*(own_names(base) for base in own_bases(kind)))
                used = set(re.findall(r"(?:self|super\(\))\.(_[a-z]\w*)", inspect.getsource(kind)))
                used |= {method for method in vars(kind) if re.match(r"_[a-z]", method)}
                found[f"{info.name}.{name}"] = (used & known) - allowed - {"_abc_impl"}
    assert len(found) > 20
    assert {name: names for name, names in found.items() if names} == {}


def own_bases(kind):
    return [base for base in kind.__mro__ if base.__module__.startswith("pipecat.")]


async def test_an_interruption_ends_what_it_overtakes():
    processor = FrameProcessor()
    end_what_is_overtaken(Pipeline([processor]))
    queue = processor._FrameProcessor__input_queue
    before = [LLMRunFrame(), TextFrame("a"), EndFrame(), UserStartedSpeakingFrame()]
    for frame in (*before, InterruptionFrame(), TextFrame("b")):
        await queue.put((frame, FrameDirection.DOWNSTREAM, None))
    kinds = [type((await queue.get())[0]) for _ in range(queue.qsize())]
    assert kinds == [UserStartedSpeakingFrame, InterruptionFrame, EndFrame, TextFrame]
    for _ in kinds:
        queue.task_done()
    await asyncio.wait_for(queue.join(), 1)
