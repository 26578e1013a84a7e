"""The shapes that are found before a runtime sees a graph are those that it makes."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from ico3d.bundle.graph.shapes import (
    FLOAT,
    INT64,
    MOST_MORE,
    ROWS,
    Array,
    HeardError,
    UnfitError,
    output,
)

Given = Sequence[tuple[int, ...] | list[int]]
"""What an operator takes: a shape of float32, or a list of whole numbers that say one."""

T = ROWS
END = np.iinfo(np.int64).max
FITS: list[tuple[str, Given, Mapping[str, Any]]] = [
    ("Add", [(T, 5), (5,)], {}),
    ("Mul", [(T, 5, 1), (T, 1, 8)], {}),
    ("Mul", [(1, 5), (T, 1)], {}),
    ("Cast", [(T, 5)], {"to": TensorProto.FLOAT}),
    ("Concat", [(T, 5), (T, 3)], {"axis": -1}),
    ("Concat", [(2, 5), (T, 5)], {"axis": 0}),
    ("Conv", [(T, 4, 80, 16), (6, 4, 5, 3), (6,)], {"strides": [2, 1], "pads": [2, 0, 1, 0]}),
    ("Conv", [(T, 4, 9), (6, 4, 2)], {"group": 1, "dilations": [3], "kernel_shape": [2]}),
    ("Flatten", [(T, 5, 3)], {}),
    ("Flatten", [(7, 5, 3)], {"axis": 3}),
    ("Flatten", [(7, 5, 3)], {"axis": -3}),
    ("Gemm", [(T, 5), (3, 5), (3,)], {"transB": 1}),
    ("Gemm", [(T, 5), (5, 3)], {}),
    ("Identity", [(T, 5)], {}),
    ("LeakyRelu", [(T, 5)], {"alpha": 0.5}),
    ("MatMul", [(T, 5), (5, 3)], {}),
    ("Pad", [(T, 5), [4, 0, 3, 1]], {}),
    ("ReduceSum", [(T, 5, 3), [-1]], {"keepdims": 0}),
    ("ReduceSum", [(T, 5, 3), [0, 2]], {}),
    ("Relu", [(T, 5)], {}),
    ("Slice", [(T + 7, 5), [3], [-4], [0]], {}),
    ("Slice", [(T + 7, 5), [7], [END], [0]], {}),
    ("Slice", [(T, 9), [1], [8], [-1], [3]], {}),
    ("Slice", [(T, 9), [0, -5], [END, -1]], {}),
    ("Softmax", [(T, 5)], {"axis": 1}),
    ("Tanh", [(T, 5)], {}),
    ("Unsqueeze", [(T, 5), [1, -1]], {}),
]


def known(given: tuple[int, ...] | list[int]) -> Array:
    if isinstance(given, list):
        return Array(INT64, (len(given),), tuple(given))
    return Array(FLOAT, given)


def found(operator: str, given: Given, settings: Mapping[str, Any]) -> tuple[int, ...]:
    whole = {n: tuple(v) if isinstance(v, list) else v for n, v in settings.items()}
    return output(operator, list(map(known, given)), whole).shape


def with_rows(shape: Sequence[int], rows: int) -> tuple[int, ...]:
    return tuple(size - ROWS + rows if size >= ROWS else size for size in shape)


@pytest.mark.parametrize("operator, given, settings", FITS)
def test_shapes_are_those_of_the_runtime(operator, given, settings):
    weights, ports, fed = [], [], {}
    for place, one in enumerate(given):
        if isinstance(one, list):
            weights.append(numpy_helper.from_array(np.array(one, np.int64), f"x{place}"))
        else:
            sizes = [None if size >= ROWS else size for size in one]
            ports.append(helper.make_tensor_value_info(f"x{place}", TensorProto.FLOAT, sizes))
            fed[f"x{place}"] = one
    node = helper.make_node(operator, [f"x{i}" for i in range(len(given))], ["y"], **settings)
    result = helper.make_tensor_value_info("y", TensorProto.FLOAT, None)
    graph = helper.make_graph([node], "one", ports, [result], weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=["CPUExecutionProvider"]
    )
    for rows in (8, 11):
        arrays = {name: np.ones(with_rows(one, rows), np.float32) for name, one in fed.items()}
        made = session.run(None, arrays)[0]
        assert made.shape == with_rows(found(operator, given, settings), rows)


UNFIT: list[tuple[str, Given, Mapping[str, Any]]] = [
    ("Add", [(T, 5), (4,)], {}),
    ("Add", [(T + 1, 5), (T, 5)], {}),
    ("Add", [(T, 5), (8, 5)], {}),
    ("Add", [(T, 5), (3, 1, 5)], {}),  # the rows would be second
    ("Add", [(T, 5)], {}),
    ("Add", [(T, 5), [1]], {}),
    ("Cast", [(T, 5)], {"to": TensorProto.STRING}),
    ("Cast", [(T, 5)], {}),
    ("Concat", [(T, 5), (T, 5)], {"axis": 0}),
    ("Concat", [(T, 5), (T + 1, 5)], {"axis": 1}),
    ("Concat", [(T, 5), (T, 5)], {}),
    ("Conv", [(T, 4, 9), (T, 4, 3)], {}),  # as many channels as rows
    ("Conv", [(T, 4, 9), (6, 3, 3)], {}),
    ("Conv", [(T, 4, 9), (6, 4, 3)], {"pads": [-1, 0]}),
    ("Conv", [(T, 4, 9), (6, 4, 3)], {"strides": [0]}),
    ("Conv", [(T, 4, 9), (6, 4, 3)], {"kernel_shape": [2]}),
    ("Conv", [(T, 4, 9), (6, 4, 11)], {}),
    ("Conv", [(T, 4, 9, 9), (6, 4, 3)], {}),
    ("Flatten", [(T, 5, 3)], {"axis": 0}),
    ("Flatten", [(T, 5, 3)], {"axis": 2}),
    ("Gemm", [(T, 5), (T, 5)], {"transB": 1}),  # a square of the rows
    ("Gemm", [(T, 5), (T, 3)], {"transA": 1}),
    ("Gemm", [(T, 5), (3, 5)], {"transB": 2}),
    ("Gemm", [(T, 5), (5, 3), (2,)], {}),
    ("MatMul", [(T,), (T, 5)], {}),
    ("MatMul", [(T, 2, 5), (T, 5, 3)], {}),  # one product for each row, and lists of all of them
    ("MatMul", [(T, 2, 5), (5, 3)], {}),
    ("Conv", [(T, 4, 9), (6, 2, 2)], {"group": 2}),
    ("MatMul", [(T, 5), (4, 3)], {}),
    ("Pad", [(T, 5), [-1, 0, 0, 0]], {}),
    ("Pad", [(T, 5), [1, 0]], {}),
    ("Pad", [(T, 5), [MOST_MORE + 1, 0, 0, 0]], {}),
    ("ReduceSum", [(T, 5), [2]], {}),
    ("ReduceSum", [(T, 5), []], {}),
    ("ReduceSum", [(T, 5), [1]], {"keepdims": 2}),
    ("Slice", [(T, 5), [8], [END], [0]], {}),  # nothing while it is tried
    ("Slice", [(T, 5), [0], [100], [0]], {}),
    ("Slice", [(T, 5), [-5], [END], [0]], {}),
    ("Slice", [(T, 5), [0], [END], [0], [2]], {}),
    ("Slice", [(T, 5), [3], [0], [1], [-1]], {}),
    ("Slice", [(T, 5), [0, 0], [1, 1], [1, 1]], {}),
    ("Slice", [(T, 5), [5], [9], [1]], {}),
    ("Softmax", [(T, 5)], {"axis": 2}),
    ("Unsqueeze", [(T, 5), [0]], {}),  # the rows would be second
    ("Unsqueeze", [(T, 5), [1, 1]], {}),
]


@pytest.mark.parametrize("operator, given, settings", UNFIT)
def test_what_a_rule_does_not_cover_is_refused(operator, given, settings):
    with pytest.raises(UnfitError):
        found(operator, given, settings)


def test_numbers_that_are_not_known_say_no_shape():
    axes = Array(INT64, (1,))
    with pytest.raises(HeardError):
        output("Unsqueeze", [Array(FLOAT, (T, 5)), axes], {})


def test_half_precision_is_for_storing_alone():
    half = Array(TensorProto.FLOAT16, (5, 3))
    with pytest.raises(UnfitError):
        output("MatMul", [Array(FLOAT, (T, 5)), half], {})
    assert output("Cast", [half], {"to": FLOAT}) == Array(FLOAT, (5, 3))
