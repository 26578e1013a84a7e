"""Checks `speech.onnx` before a runtime loads it: standard operators, weights inside.

The check reads protobuf's wire format directly, so that a server needs no onnx package. Field
numbers are those of onnx.proto (ModelProto, GraphProto, NodeProto, AttributeProto, TensorProto).
"""

import itertools
from collections.abc import Iterator

from ico3d.errors import BundleError

_GRAPH, _FUNCTIONS = 7, 25
_NODE, _INITIALIZER, _SPARSE, _INPUT, _OUTPUT = 1, 5, 15, 11, 12
_OP_TYPE, _ATTRIBUTE, _DOMAIN = 4, 5, 7
_TENSOR, _SUBGRAPHS = 5, (6, 11)
_EXTERNAL, _LOCATION = 13, 14
_NAME, _TENSOR_NAME = 1, 8
OPERATORS = {
    "Add",
    "Cast",
    "Concat",
    "Constant",
    "Conv",
    "Flatten",
    "Gemm",
    "Identity",
    "LeakyRelu",
    "MatMul",
    "Mul",
    "Pad",
    "ReduceSum",
    "Relu",
    "Slice",
    "Softmax",
    "Tanh",
    "Unsqueeze",
}
"""Allowed operators: those of feed-forward graphs such as `speech.export` writes.

There are no loops and no random numbers among them.
"""

Value = int | memoryview
Count = Iterator[int]
MOST_FIELDS = 100_000
"""Fields that are looked at, some ten for each operator of a graph and five for each weight: empty
ones have two bytes, and a runtime takes 30 kB for each operator."""


OPTIONAL_INPUT = "told"
"""Input that a model may have besides its own, with a value for when it is not given."""


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
            or it refers to other files.
    """
    try:
        count = itertools.count()
        graphs: list[memoryview] = []
        for field, value in _fields(memoryview(data), count):
            if field == _FUNCTIONS:
                raise BundleError(f"{name}: defines functions of its own.")
            if field == _GRAPH:
                graphs.append(_bytes(value))
        if len(graphs) != 1:
            raise ValueError("no graph")
        _check_graph(graphs[0], count, name, input_name, output_name)
    except (ValueError, IndexError) as error:
        raise BundleError(f"{name}: is not an ONNX model.") from error


def _check_graph(
    graph: memoryview, count: Count, name: str, input_name: str, output_name: str
) -> None:
    names: dict[int, list[str]] = {_INPUT: [], _OUTPUT: []}
    weights: set[str] = set()
    for field, value in _fields(graph, count):
        if field == _NODE:
            _check_node(_bytes(value), count, name)
        elif field == _INITIALIZER:
            _check_tensor(_bytes(value), count, name)
            weights.add(_text(_bytes(value), count, _TENSOR_NAME))
        elif field == _SPARSE:
            raise BundleError(f"{name}: has sparse weights.")
        elif field in names:
            names[field].append(_text(_bytes(value), count, _NAME))
    if OPTIONAL_INPUT in weights and names[_INPUT][1:] == [OPTIONAL_INPUT]:
        del names[_INPUT][1]
    if names != {_INPUT: [input_name], _OUTPUT: [output_name]}:
        raise BundleError(f"{name}: must lead from '{input_name}' to '{output_name}'.")


def _check_node(node: memoryview, count: Count, name: str) -> None:
    operator = _text(node, count, _OP_TYPE)
    if _text(node, count, _DOMAIN) not in ("", "ai.onnx") or operator not in OPERATORS:
        raise BundleError(f"{name}: uses the operator {operator[:40]!r}.")
    for field, value in _fields(node, count):
        if field == _ATTRIBUTE:
            for inner, part in _fields(_bytes(value), count):
                if inner in _SUBGRAPHS:
                    raise BundleError(f"{name}: holds a graph within a graph.")
                if inner == _TENSOR:
                    _check_tensor(_bytes(part), count, name)


def _check_tensor(tensor: memoryview, count: Count, name: str) -> None:
    for field, value in _fields(tensor, count):
        if field == _EXTERNAL or (field == _LOCATION and value):
            raise BundleError(f"{name}: keeps weights in another file.")


def _text(message: memoryview, count: Count, wanted: int) -> str:
    """The last string in a field, which is the one that counts; empty where there is none."""
    found = b""
    for field, value in _fields(message, count):
        if field == wanted:
            found = _bytes(value)
    return bytes(found).decode()


def _fields(message: memoryview, count: Count) -> Iterator[tuple[int, Value]]:
    """The (field number, value) pairs of a message; 32- and 64-bit numbers stay bytes.

    Raises:
        ValueError: If the message is damaged, or it is one field too many of the model.
    """
    position = 0
    while position < len(message):
        if next(count) >= MOST_FIELDS:
            raise ValueError("too many fields")
        key, position = _varint(message, position)
        kind = key & 7
        if kind == 0:
            value, position = _varint(message, position)
            yield key >> 3, value
            continue
        if kind == 2:
            length, position = _varint(message, position)
        elif kind in (1, 5):
            length = 8 if kind == 1 else 4
        else:
            raise ValueError("no such wire type")
        if position + length > len(message):
            raise ValueError("cut off")
        yield key >> 3, message[position : position + length]
        position += length


def _varint(message: memoryview, position: int) -> tuple[int, int]:
    """A number of up to ten bytes and the position behind it."""
    value = 0
    for shift in range(0, 70, 7):
        byte = message[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, position
    raise ValueError("number too long")


def _bytes(value: Value) -> memoryview:
    if isinstance(value, int):
        raise ValueError("a number where a message was expected")
    return value
