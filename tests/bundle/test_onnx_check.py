"""What is refused in speech.onnx before a runtime sees it."""

import itertools
import tracemalloc

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper

from ico3d.bundle import onnx_check
from ico3d.bundle.onnx_check import check_onnx
from ico3d.errors import BundleError
from support.bundles.random_bundle import speech_graph

GRAPH = speech_graph()


def check(data: bytes) -> None:
    check_onnx(data, "speech.onnx", "mel", "expression")


def refused(model: onnx.ModelProto, message: str) -> None:
    with pytest.raises(BundleError, match=message):
        check(model.SerializeToString())


@pytest.fixture
def model() -> onnx.ModelProto:
    return onnx.load_from_string(GRAPH)


def test_a_plain_graph_passes():
    check(GRAPH)


def test_exported_speech_passes():
    import torch

    from ico3d.speech.encoder import load_encoder
    from ico3d.speech.export import export_speech
    from ico3d.speech.network import SpeechAdaptor

    torch.manual_seed(0)
    encoder = load_encoder("builtin")
    check(export_speech(SpeechAdaptor(encoder.size), encoder))


def test_weights_in_another_file_are_refused(model):
    weights = model.graph.initializer[0]
    entry = weights.external_data.add()
    entry.key, entry.value = "location", "/etc/passwd"
    weights.data_location = TensorProto.EXTERNAL
    refused(model, "another file")


def test_a_constant_in_another_file_is_refused(model):
    weights = numpy_helper.from_array(np.zeros(3, np.float32), "c")
    weights.data_location = TensorProto.EXTERNAL
    model.graph.node.append(helper.make_node("Constant", [], ["c"], value=weights))
    refused(model, "another file")


@pytest.mark.parametrize("operator", ["Loop", "If", "Scan", "ConstantOfShape", "RandomNormal", "X"])
def test_other_operators_are_refused(model, operator):
    model.graph.node.append(helper.make_node(operator, ["mel"], ["y"]))
    refused(model, operator)


def test_operators_of_other_domains_are_refused(model):
    model.graph.node[0].domain = "com.microsoft"
    refused(model, "Flatten")


def test_graphs_within_graphs_are_refused(model):
    attribute = helper.make_attribute("body", model.graph)
    model.graph.node[0].attribute.append(attribute)
    refused(model, "graph within a graph")


def test_functions_are_refused(model):
    function = helper.make_function("own", "F", ["a"], ["a"], [], [helper.make_opsetid("", 17)])
    model.functions.append(function)
    refused(model, "functions")


@pytest.mark.parametrize("part", ["input", "output"])
def test_other_inputs_and_outputs_are_refused(model, part):
    getattr(model.graph, part)[0].name = "other"
    refused(model, "'mel' to 'expression'")


def test_a_second_input_needs_its_name_and_a_value_of_its_own(model):
    model.graph.input.append(helper.make_tensor_value_info("told", TensorProto.FLOAT, [None, 6]))
    refused(model, "'mel' to 'expression'")
    model.graph.initializer.append(numpy_helper.from_array(np.zeros((1, 6), np.float32), "told"))
    check(model.SerializeToString())
    model.graph.input[1].name = model.graph.initializer[-1].name = "other"
    refused(model, "'mel' to 'expression'")


@settings(max_examples=300)
@given(st.binary(max_size=60) | st.integers(0, len(GRAPH) - 1).map(lambda n: GRAPH[:n]))
def test_garbage_is_refused(data):
    with pytest.raises(BundleError, match=r"speech\.onnx"):
        check(data)


@settings(max_examples=300)
@given(st.integers(0, 300), st.integers(1, 255))
def test_damage_is_refused_or_harmless(place, change):
    data = bytearray(GRAPH)
    data[place] ^= change
    try:
        check(bytes(data))
    except BundleError as error:
        assert str(error).startswith("speech.onnx: ")


def fields(number: int, count: int) -> bytes:
    """Empty fields of a number, of two bytes each."""
    return bytes([number << 3 | 2, 0]) * count


def test_a_graph_of_millions_of_empty_fields_takes_no_memory(model):
    """Each of them was kept: 100 bytes of memory for two of the file."""
    node = fields(7, 1_000_000)  # names of the operator's domain
    size = len(node)
    length = b""
    while size > 127:
        length += bytes([size & 127 | 128])
        size >>= 7
    length += bytes([size])
    graph = b"\x0a" + length + node
    size, head = len(graph), b""
    while size > 127:
        head += bytes([size & 127 | 128])
        size >>= 7
    data = b"\x3a" + head + bytes([size]) + graph
    tracemalloc.start()
    with pytest.raises(BundleError, match="is not an ONNX model"):
        check(data)
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


def test_a_graph_of_ten_thousands_of_operators_is_refused(model):
    last = model.graph.output[0].name
    for number in range(30_000):
        model.graph.node.append(helper.make_node("Relu", [last], [f"r{number}"]))
    refused(model, "is not an ONNX model")


def test_the_last_of_several_names_counts(model):
    node = model.graph.node[0]
    twice = node.SerializeToString() + b"\x22\x04Loop"  # another operator's name
    changed = onnx.NodeProto.FromString(twice)
    assert changed.op_type == "Loop"
    assert onnx_check._text(memoryview(twice), itertools.count(), 4) == "Loop"
