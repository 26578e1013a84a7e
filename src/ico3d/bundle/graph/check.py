"""Checks `speech.onnx` before a runtime loads it: standard operators, weights inside, small cost.

The check reads protobuf's wire format directly, so that a server needs no onnx package. Field
numbers are those of onnx.proto.
"""

import math
from typing import Any

import numpy as np

from ico3d.bundle.graph.cost import Step, check_cost
from ico3d.bundle.graph.shapes import (
    FLOAT,
    INT64,
    MOST_DIMENSIONS,
    MOST_SIZE,
    ROWS,
    RULES,
    Array,
)
from ico3d.common.expression import SPEECH_SIZE
from ico3d.common.unpacking.protobuf import Form, Message, Reader, RefusedFieldError
from ico3d.errors import BundleError
from ico3d.speech.mel import MELS, WINDOW

MOST_FIELDS = 100_000
"""Fields that are read, some ten for each operator of a graph and five for each weight."""
MOST_TEXT = 1 << 20
"""Bytes of names and notes."""
MOST_OPERATORS = 5_000
"""A runtime takes 30 kB for each of them."""
MOST_SETTING = 1 << 20
"""How large whole numbers among the attributes of operators may be, such as strides and pads."""

OPTIONAL_INPUT = "told"
"""Input that a model may have besides its own, with a value for when it is not given."""

_OTHER_FORMAT = b"ORTM"
"""At the fifth byte, by which runtimes know models of a format that nobody checks here."""
_ELSEWHERE, _NESTED = "keeps weights in another file", "holds a graph within a graph"
_DOMAINS = ("", "ai.onnx")
_WIDTHS = {1: 4, 6: 4, 7: 8, 9: 1, 10: 2, 11: 8}
"""Bytes of a number by its type: float32, int32, int64, bool, float16, float64."""
_VALUES = {1: 2, 2: 3, 4: 5, 7: 8}
"""The field that holds an attribute's value, by the attribute's type."""
_OPERATOR_SETS = range(13, 18)
"""Versions of ONNX's operators whose rules `shapes` has."""
_SAID = 64
"""Numbers of a weight that may say a shape, at most."""
_MEL = (MELS, WINDOW)

_TENSOR = Form(
    "weights",
    once={2: "number", 8: "text", 9: "bytes", 12: "text", 14: "number"},
    many={1: "number"},
    refused={13: _ELSEWHERE},
)
_ATTRIBUTE = Form(
    "attribute",
    once={1: "text", 2: "float", 3: "number", 5: _TENSOR, 13: "text", 20: "number"},
    many={8: "number"},
    refused={
        4: "computes with words",
        9: "computes with words",
        6: _NESTED,
        11: _NESTED,
        22: "has sparse weights",
        23: "has sparse weights",
    },
)
_NODE = Form(
    "operator",
    once={3: "text", 4: "text", 6: "text", 7: "text"},
    many={1: "text", 2: "text", 5: _ATTRIBUTE},
)
_DIMENSION = Form("dimension", once={1: "number", 2: "text"})
_SHAPE = Form("shape", many={1: _DIMENSION})
_ARRAY = Form("array", once={1: "number", 2: _SHAPE})
_TYPE = Form("type", once={1: _ARRAY})
_PORT = Form("input or output", once={1: "text", 2: _TYPE, 3: "text"})
_GRAPH = Form(
    "graph",
    once={2: "text", 10: "text"},
    many={1: _NODE, 5: _TENSOR, 11: _PORT, 12: _PORT},
    refused={15: "has sparse weights"},
)
_OPERATOR_SET = Form("operator set", once={1: "text", 2: "number"})
_MODEL = Form(
    "model",
    once={1: "number", 2: "text", 3: "text", 4: "text", 5: "number", 6: "text", 7: _GRAPH},
    many={8: _OPERATOR_SET},
    refused={25: "defines functions of its own"},
)


def check_onnx(data: bytes, name: str, input_name: str, output_name: str) -> None:
    """Checks that a model is self-contained and has the expected input and output.

    Args:
        data: Content of the file.
        name: Name of the file, for errors.
        input_name: Expected name of the graph's only input; `OPTIONAL_INPUT` may follow it, if
            the model has a weight of the same name.
        output_name: Expected name of the graph's only output.

    Raises:
        BundleError: If the data are no ONNX model, the model uses operators that are not allowed,
            it refers to other files, it holds anything that such a model has no use for, or it
            takes more memory or time than such a model (`graph.cost`).
    """
    try:
        if data[4:8] == _OTHER_FORMAT:
            raise ValueError("another format")
        model = Reader(MOST_FIELDS, MOST_TEXT).read(memoryview(data), _MODEL)
        if any(used.one(1, "") not in _DOMAINS for used in model.all(8)):
            raise RefusedFieldError("uses operators that are no standard ones")
        if [used.one(2, 0) in _OPERATOR_SETS for used in model.all(8)] != [True]:
            raise RefusedFieldError("needs operators of another version than 13 to 17")
        graph = model.one(7, None)
        if graph is None:
            raise ValueError("no graph")
        _check_graph(graph)
        _check_ports(graph, input_name, output_name)
        known = _weights(graph) | _inputs(graph)
        steps = [_step(node) for node in graph.all(1)]
        check_cost(steps, known, output_name, (ROWS, SPEECH_SIZE))
    except RefusedFieldError as error:
        raise BundleError(f"{name}: {error}.") from error
    except (ValueError, IndexError) as error:
        raise BundleError(f"{name}: is not an ONNX model.") from error


def _check_graph(graph: Message) -> None:
    if len(graph.all(1)) > MOST_OPERATORS:
        raise RefusedFieldError(f"has more than {MOST_OPERATORS:,} operators")
    for node in graph.all(1):
        _check_node(node)
    for weights in graph.all(5):
        _check_tensor(weights)
    for port in (*graph.all(11), *graph.all(12)):
        array = port.one(2, Message({})).one(1, Message({}))
        dimensions = array.one(2, Message({})).all(1)
        _check_dimensions([dimension.one(1, 1) for dimension in dimensions])
        if array.one(1, 0) != FLOAT:
            raise RefusedFieldError("must lead from float32 to float32")


def _check_ports(graph: Message, input_name: str, output_name: str) -> None:
    inputs, outputs = ([port.one(1, "") for port in graph.all(side)] for side in (11, 12))
    weights = {tensor.one(8, "") for tensor in graph.all(5)}
    if OPTIONAL_INPUT in weights and inputs[1:] == [OPTIONAL_INPUT]:
        del inputs[1]
    if (inputs, outputs) != ([input_name], [output_name]):
        raise RefusedFieldError(f"must lead from '{input_name}' to '{output_name}'")


def _check_node(node: Message) -> None:
    operator = node.one(4, "")
    if node.one(7, "") not in _DOMAINS or operator not in RULES:
        raise RefusedFieldError(f"uses the operator {operator[:40]!r}")
    allowed = RULES[operator].settings
    names = [attribute.one(1, "") for attribute in node.all(5)]
    if len(set(names)) != len(names) or len(node.all(2)) != 1:
        raise ValueError("an attribute twice, or another number of outputs")
    for attribute in node.all(5):
        if allowed.get(attribute.one(1, "")) != attribute.one(20, 0):
            raise RefusedFieldError(f"has an attribute of {operator} that nothing is known of")
        if set(attribute.fields) - {1, 13, 20} - {_VALUES[attribute.one(20, 0)]}:
            raise ValueError("an attribute of another type than it says")
        for tensor in attribute.all(5):
            _check_tensor(tensor)
        numbers = [*attribute.all(3), *attribute.all(8)]
        if any(abs(_signed(n)) > MOST_SETTING for n in numbers):
            raise ValueError("an attribute too large")


def _check_tensor(tensor: Message) -> None:
    """A tensor must store all numbers that it claims, in itself and as they are in memory."""
    if tensor.one(14, 0):
        raise RefusedFieldError(_ELSEWHERE)
    sizes, width = tensor.all(1), _WIDTHS.get(tensor.one(2, 0))
    _check_dimensions(sizes)
    if width is None or math.prod(sizes) * width != len(tensor.one(9, b"")):
        raise ValueError("weights of another size than they claim")


def _check_dimensions(sizes: list[int]) -> None:
    if len(sizes) > MOST_DIMENSIONS or not all(1 <= size < MOST_SIZE for size in sizes):
        raise ValueError("too many or too large dimensions")


def _weights(graph: Message) -> dict[str, Array]:
    """What is known of the weights, by name."""
    found = {tensor.one(8, ""): _array(tensor) for tensor in graph.all(5)}
    if len(found) != len(graph.all(5)) or "" in found:
        raise ValueError("weights without a name, or of one name")
    return found


def _array(tensor: Message) -> Array:
    """What is known of a weight or a constant."""
    kind, shape = tensor.one(2, 0), tuple(tensor.all(1))
    says = kind == INT64 and math.prod(shape) <= _SAID
    values = np.frombuffer(tensor.one(9, b""), "<i8").tolist() if says else None
    return Array(kind, shape, None if values is None else tuple(values))


def _inputs(graph: Message) -> dict[str, Array]:
    """What is known of the inputs, by name."""
    found, weights = dict(map(_input, graph.all(11))), _weights(graph)
    for name in found.keys() & weights.keys():
        one_row = Array(FLOAT, (1, *found[name].shape[1:]))
        if name != OPTIONAL_INPUT or weights[name] != one_row:
            raise RefusedFieldError("has something other than a row for when nothing is told")
    return found


def _input(port: Message) -> tuple[str, Array]:
    """Name of an input, and what is known of it: any number of rows of a stated size."""
    name = port.one(1, "")
    array = port.one(2, Message({})).one(1, Message({})).one(2, Message({}))
    rows, *row = [dimension.one(1, None) for dimension in array.all(1)] or [0]
    fits = tuple(row) == _MEL if name == "mel" else len(row) == 1 and None not in row
    if rows is not None or not fits:
        raise RefusedFieldError(f"must take any number of rows of a stated size as '{name}'")
    return name, Array(FLOAT, (ROWS, *row))


def _step(node: Message) -> Step:
    """An operator of the graph."""
    settings = {attribute.one(1, ""): _setting(attribute) for attribute in node.all(5)}
    return Step(node.one(4, ""), tuple(node.all(1)), node.all(2)[0], settings)


def _setting(attribute: Message) -> Any:
    """The value of an attribute; one that is not written is 0, or a list of nothing."""
    match attribute.one(20, 0):
        case 1:
            return attribute.one(2, None)
        case 2:
            return _signed(attribute.one(3, 0))
        case 4:
            return _array(attribute.one(5, Message({})))
        case _:
            return tuple(map(_signed, attribute.all(8)))


def _signed(number: int) -> int:
    """What 64 bits stand for in two's complement."""
    return number - (1 << 64) if number >> 63 else number
