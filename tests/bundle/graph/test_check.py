"""What is refused in speech.onnx before a runtime sees it."""

import itertools
import tracemalloc
from types import SimpleNamespace

import numpy as np
import onnx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper

from ico3d.bundle.graph import check as checking
from ico3d.bundle.graph import cost
from ico3d.bundle.graph.check import check_onnx
from ico3d.common.unpacking.protobuf import _varint
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


@pytest.mark.parametrize("name, size, vectors", [("builtin", 64, 1), ("a", 512, 1), ("h", 2048, 2)])
def test_exported_speech_passes_with_room_to_spare(monkeypatch, name, size, vectors):
    import torch

    from ico3d.speech.encoder import load_encoder
    from ico3d.speech.export import export_speech
    from ico3d.speech.network import SpeechAdaptor

    torch.manual_seed(0)
    encoder = load_encoder("builtin")
    assert encoder.articulation is not None  # the graph has the input 'told'
    if name != "builtin":
        encoder = SimpleNamespace(name=name, size=size)
    adaptor = SpeechAdaptor(size, vectors)
    adaptor.lips += 0.5
    monkeypatch.setattr(cost, "MOST_PRODUCTS", cost.MOST_PRODUCTS // 8)
    monkeypatch.setattr(cost, "MOST_NUMBERS", cost.MOST_NUMBERS // 6)
    takes = "mel" if name == "builtin" else "features"
    check_onnx(export_speech(adaptor, encoder), "speech.onnx", takes, "expression")


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


def number(value: int) -> bytes:
    """A number as protobuf writes it."""
    low, rest = value & 127, value >> 7
    return bytes([low | 128]) + number(rest) if rest else bytes([low])


def field(tag: int, content: bytes) -> bytes:
    return number(tag << 3 | 2) + number(len(content)) + content


def extended(message: bytes, path: list[int], more: bytes) -> bytes:
    """A message with more bytes in the first of its messages along a path of field numbers."""
    if not path:
        return message + more
    position = 0
    while position < len(message):
        begin = position
        tag, position = _varint(memoryview(message), position)
        if tag & 7 == 0:
            _, position = _varint(memoryview(message), position)
            continue
        size, position = (4, position) if tag & 7 == 5 else _varint(memoryview(message), position)
        inner = message[position : position + size]
        position += size
        if tag >> 3 == path[0]:
            changed = field(path[0], extended(inner, path[1:], more))
            return message[:begin] + changed + message[position:]
    raise AssertionError(path)


def small() -> onnx.ModelProto:
    """A model that has all messages: a value of a constant, added to what is sliced."""
    value = numpy_helper.from_array(np.ones(32, np.float32))
    ranges = {"first": [0], "last": [32], "axis": [1]}
    nodes = [
        helper.make_node("Constant", [], ["one"], value=value),
        helper.make_node("Flatten", ["mel"], ["flat"], axis=1),
        helper.make_node("Slice", ["flat", *ranges], ["some"]),
        helper.make_node("Add", ["some", "one"], ["expression"]),
    ]
    weights = [numpy_helper.from_array(np.array(v, "i8"), name) for name, v in ranges.items()]
    mel = helper.make_tensor_value_info("mel", TensorProto.FLOAT, ["rows", 80, 16])
    out = helper.make_tensor_value_info("expression", TensorProto.FLOAT, ["rows", 32])
    graph = helper.make_graph(nodes, "small", [mel], [out], weights)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)


MESSAGES = [
    ([], {1, 2, 3, 4, 5, 6, 7, 8}),
    ([7], {1, 2, 5, 10, 11, 12}),
    ([7, 1], {1, 2, 3, 4, 5, 6, 7}),
    ([7, 1, 5], {1, 2, 3, 5, 8, 13, 20}),
    ([7, 1, 5, 5], {1, 2, 8, 9, 12, 14}),
    ([7, 5], {1, 2, 8, 9, 12, 14}),
    ([7, 11], {1, 2, 3}),
    ([7, 12, 2], {1}),
    ([7, 11, 2, 1], {1, 2}),
    ([7, 12, 2, 1, 2], {1}),
    ([7, 11, 2, 1, 2, 1], {1, 2}),
    ([8], {1, 2}),
]
"""The way to each message and the fields that it may hold."""


@pytest.mark.parametrize("path, listed", MESSAGES)
def test_no_field_passes_that_is_not_listed(path, listed):
    """A runtime reads the lowest 32 bits of a tag: field n + 2²⁹ is field n to it."""
    data = small().SerializeToString()
    check(data)
    contents = {0: b"\1", 1: bytes(8), 2: b"\0", 3: b"", 4: b"", 5: bytes(4)}
    for tag, kind in itertools.product(range(65), contents):
        for far in [0, 1 << 29]:
            if far or tag not in listed:
                more = number((tag + far) << 3 | kind) + contents[kind]
                with pytest.raises(BundleError, match=r"^speech\.onnx: "):
                    check(extended(data, path, more))


def test_notes_pass_within_a_bound(monkeypatch):
    model = small()
    model.producer_name = model.producer_version = model.domain = model.doc_string = "note"
    model.model_version = 3
    graph = model.graph
    for one in (graph, graph.node[0], graph.node[0].attribute[0], graph.input[0]):
        one.doc_string = "note"
    graph.initializer[0].doc_string = graph.node[0].name = "note"
    check(model.SerializeToString())
    monkeypatch.setattr(checking, "MOST_TEXT", 100)
    refused(model, "is not an ONNX model")


def sparse() -> onnx.SparseTensorProto:
    tensor = helper.make_tensor("v", TensorProto.FLOAT, [1], [1.0])
    places = helper.make_tensor("i", TensorProto.INT64, [1], [0])
    return helper.make_sparse_tensor(tensor, places, [300_000_000])


def test_a_sparse_constant_is_refused():
    """It read a file of the server's folder, or claimed 300 million numbers of which it has one."""
    model = small()
    model.graph.node.append(helper.make_node("Constant", [], ["c"], sparse_value=sparse()))
    refused(model, "has sparse weights")


def test_shapes_of_values_in_between_are_refused():
    """Thirty megabytes of them took 2.2 GB."""
    model = small()
    model.graph.value_info.append(helper.make_tensor_value_info("flat", TensorProto.FLOAT, [1]))
    refused(model, "unexpected field 13 in its graph")


@pytest.mark.parametrize(
    "kind, sizes, raw",
    [
        (TensorProto.FLOAT, [3], bytes(8)),
        (TensorProto.FLOAT, [3], None),
        (TensorProto.FLOAT, [1 << 40, 0], None),
        (TensorProto.FLOAT, [-1, -1], bytes(4)),
        (TensorProto.FLOAT, [1] * 9, bytes(4)),
        (TensorProto.STRING, [1], bytes(4)),
        (TensorProto.UNDEFINED, [1], bytes(4)),
    ],
)
def test_weights_hold_all_numbers_that_they_claim(kind, sizes, raw):
    model = small()
    weights = model.graph.initializer.add(name="w", data_type=kind, dims=sizes)
    if raw is not None:
        weights.raw_data = raw
    refused(model, "is not an ONNX model")


def test_inputs_are_of_numbers_and_of_some_size():
    model = small()
    model.graph.input[0].type.tensor_type.elem_type = TensorProto.STRING
    refused(model, "from float32 to float32")
    model = small()
    model.graph.input[0].type.tensor_type.shape.dim[1].dim_value = 1 << 40
    refused(model, "is not an ONNX model")


def test_an_attribute_is_of_the_type_that_it_states_and_not_too_large():
    model = small()
    model.graph.node[1].attribute[0].ints.append(1)
    refused(model, "is not an ONNX model")
    model = small()
    model.graph.node[1].attribute[0].i = 1 << 40
    refused(model, "is not an ONNX model")


@pytest.mark.parametrize("name", ["mel", "flat", "one"])
def test_no_shape_depends_on_what_is_heard(name):
    """Such a graph passes the first run, which is of silence, and takes its time later."""
    model = small()
    model.graph.node[2].input[2] = name
    refused(model, "makes its shapes of what it hears")


def test_words_are_no_numbers():
    """Their letters lie outside of a runtime's bounded memory: 2 MB became 81 GB."""
    model = small()
    model.graph.node[0].attribute[0].CopyFrom(helper.make_attribute("value_string", "0"))
    refused(model, "computes with words")
    model.graph.node[0].attribute[0].CopyFrom(helper.make_attribute("value_strings", ["0"]))
    refused(model, "computes with words")
    model = small()
    model.graph.node[3].CopyFrom(
        helper.make_node("Cast", ["some"], ["expression"], to=TensorProto.STRING)
    )
    refused(model, "operator Cast with a cast to something other than float32")


def test_what_is_there_for_later_rows_alone_is_refused():
    """It costs nothing while a graph is tried, with eight rows."""
    model = small()
    for name, number in (("first", 8), ("last", 1 << 30), ("axis", 0)):
        weights = next(w for w in model.graph.initializer if w.name == name)
        weights.raw_data = np.array([number], "i8").tobytes()
    refused(model, "operator Slice with rows in another number than are heard")


@pytest.mark.parametrize("attributes", [{"value_float": 1.0}, {}])
def test_a_constant_is_a_tensor(attributes):
    model = small()
    model.graph.node[0].CopyFrom(helper.make_node("Constant", [], ["one"], **attributes))
    refused(model, "of Constant that nothing is known of|operator Constant that fits nothing")


def test_attributes_and_versions_are_those_of_the_rules():
    model = small()
    model.graph.node[1].attribute[0].name = "other"
    refused(model, "an attribute of Flatten that nothing is known of")
    model = small()
    model.graph.node[1].attribute.append(helper.make_attribute("axis", 1))
    refused(model, "is not an ONNX model")
    for versions in ([18], [12], [17, 17], []):
        model = small()
        del model.opset_import[:]
        model.opset_import.extend(helper.make_opsetid("", version) for version in versions)
        refused(model, "operators of another version than 13 to 17")


def test_inputs_take_any_number_of_rows():
    model = small()
    model.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 8
    refused(model, "any number of rows of a stated size as 'mel'")
    model = small()
    model.graph.input[0].type.tensor_type.shape.dim[2].dim_value = 17
    refused(model, "any number of rows of a stated size as 'mel'")


def test_what_is_told_is_one_row_unless_it_is_given():
    model = small()
    model.graph.input.append(helper.make_tensor_value_info("told", TensorProto.FLOAT, [None, 6]))
    told = numpy_helper.from_array(np.zeros((2, 6), np.float32), "told")
    model.graph.initializer.append(told)
    refused(model, "something other than a row for when nothing is told")
    model.graph.initializer[-1].name = "mel"
    refused(model, "must lead from 'mel' to 'expression'")


def test_bytes_that_are_a_format_of_the_runtime_as_well_are_refused():
    data = field(6, b"\0\0ORTM") + small().SerializeToString()
    onnx.load_from_string(data)
    with pytest.raises(BundleError, match="not an ONNX model"):
        check(data)


def test_a_graph_of_millions_of_empty_fields_takes_no_memory():
    """Each of them was kept: 100 bytes of memory for two of the file."""
    data = extended(small().SerializeToString(), [7], field(1, field(1, b"") * 1_000_000))
    tracemalloc.start()
    with pytest.raises(BundleError, match="is not an ONNX model"):
        check(data)
    assert tracemalloc.get_traced_memory()[1] < 16 << 20
    tracemalloc.stop()


def test_a_graph_of_ten_thousands_of_operators_is_refused(model):
    last = model.graph.output[0].name
    for number in range(30_000):
        model.graph.node.append(helper.make_node("Relu", [last], [f"r{number}"]))
    refused(model, "is not an ONNX model")
    del model.graph.node[checking.MOST_OPERATORS + 1 :]
    refused(model, "more than 5,000 operators")


def test_an_operator_of_two_names_is_refused():
    data = extended(small().SerializeToString(), [7, 1], field(4, b"Loop"))
    assert onnx.load_from_string(data).graph.node[0].op_type == "Loop"
    with pytest.raises(BundleError, match="is not an ONNX model"):
        check(data)
