"""Graphs of strangers' bundles, which pass the check of their operators."""

import time

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper

from ico3d.bundle.graph.check import check_onnx
from ico3d.errors import BundleError, ModelError
from ico3d.speech import runtime
from ico3d.speech.runtime import SpeechModel

pytestmark = pytest.mark.slow

TIMES = 64  # that a step repeats what it gets


def graph(begin: list, steps: int, values: int = 32) -> bytes:
    """The bytes of a graph that repeats `x0` and gives some of it; `begin` makes `x0`."""
    ranges = {"first": [0], "last": [values], "axis": [1]}
    weights = [numpy_helper.from_array(np.array(v, "i8"), name) for name, v in ranges.items()]
    nodes = [helper.make_node("Flatten", ["mel"], ["flat"], axis=1), *begin]
    for step in range(steps):
        again = [f"x{step}"] * TIMES
        nodes.append(helper.make_node("Concat", again, [f"x{step + 1}"], axis=1))
    nodes.append(helper.make_node("Slice", [f"x{steps}", *ranges], ["some"]))
    nodes.append(helper.make_node("Slice", ["flat", *ranges], ["own"]))
    nodes.append(helper.make_node("Add", ["some", "own"], ["expression"]))
    mel = helper.make_tensor_value_info("mel", TensorProto.FLOAT, ["rows", 80, 16])
    out = helper.make_tensor_value_info("expression", TensorProto.FLOAT, ["rows", values])
    made = helper.make_graph(nodes, "strange", [mel], [out], weights)
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return model.SerializeToString()


def repeated() -> list:
    return [helper.make_node("Identity", ["flat"], ["x0"])]


def constant() -> list:
    """Would be repeated while the graph is opened, as nothing in it is heard."""
    value = numpy_helper.from_array(np.ones((1, 1280), np.float32))
    return [helper.make_node("Constant", [], ["x0"], value=value)]


@pytest.mark.parametrize("begin", [repeated, constant])
def test_a_graph_that_grows_gets_no_more_memory_than_the_bound(begin):
    data = graph(begin(), 3)  # 10 GB, or 1 GB and a quarter, of a few kilobytes
    with pytest.raises(BundleError, match="more memory or time than a talk has"):
        check_onnx(data, "speech.onnx", "mel", "expression")
    begun = time.process_time()
    with pytest.raises(ModelError, match="cannot be run within 1024 MiB"):
        SpeechModel(data)
    assert time.process_time() - begun < 10
    sound = SpeechModel(graph(begin(), 1)).expressions(np.zeros(48_000, np.float32), 16_000)
    assert sound.shape == (76, 32)  # the bound is no obstacle to others


def test_a_graph_of_other_values_is_refused():
    with pytest.raises(ModelError, match="gives 7 values, not 32"):
        SpeechModel(graph(repeated(), 1, values=7))


def test_the_values_of_a_long_sound_are_computed_piece_by_piece(monkeypatch):
    model = SpeechModel(graph(repeated(), 1))
    rows, run = [], model.run
    monkeypatch.setattr(
        model, "run", lambda heard, told=None: rows.append(len(heard)) or run(heard)
    )
    assert len(model.expressions(np.zeros(90 * 16_000, np.float32), 16_000)) == 2251
    assert max(rows) < 1000


def test_a_run_that_takes_too_long_ends_amid_the_graph():
    nodes = [helper.make_node("Concat", ["flat"] * TIMES, ["y0"], axis=1)]
    for step in range(300):
        nodes.append(helper.make_node("Tanh", [f"y{step}"], [f"y{step + 1}"]))
    nodes.append(helper.make_node("Identity", ["y300"], ["x0"]))
    session = runtime._session(graph(nodes, 0), "it", bounded=True)
    mel = np.ones((100, 80, 16), np.float32)
    begun = time.process_time()
    with pytest.raises(Exception, match="terminate"):
        runtime._within(0.2, session, {"mel": mel})
    assert time.process_time() - begun < 1
    assert runtime._within(60.0, session, {"mel": mel[:1]}).shape == (1, 32)


def test_a_graph_that_takes_too_long_in_silence_is_refused(monkeypatch):
    monkeypatch.setattr(runtime, "MOST_SECONDS", -1.0)  # over before it begins
    with pytest.raises(ModelError, match=r"cannot be run within 1024 MiB and -1 s: "):
        SpeechModel(graph(repeated(), 1))


def test_a_stranger_s_bytes_are_read_as_onnx_alone():
    """At the fifth byte the runtime's other format has its name."""
    with pytest.raises(ModelError, match="protobuf parsing failed"):
        SpeechModel(b"\x32\x10\0\0ORTM" + bytes(80))


def test_what_a_graph_is_called_is_said_by_nobody_but_the_error(capfd):
    """onnxruntime would quote names to the terminal, escapes and all."""
    node = helper.make_node("Reshape", ["flat", "last"], ["row"], name="a\x1b]0;pwned\x07")
    rows = helper.make_node("Unsqueeze", ["row", "first"], ["x0"])
    with pytest.raises(ModelError, match=r"cannot be run within 1024 MiB and 5 s") as refused:
        SpeechModel(graph([node, rows], 0))
    assert "pwned" in str(refused.value) and "\x1b" not in str(refused.value)
    assert capfd.readouterr().err == ""
