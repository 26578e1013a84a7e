"""Exports speech networks to ONNX, for servers without torch."""

from pathlib import Path

import numpy as np
import torch
from torch import nn

from ico3d.common.files import write_atomic
from ico3d.common.weights import find_model, model_folders
from ico3d.errors import MissingExtraError
from ico3d.speech.encoder import FrozenEncoder
from ico3d.speech.hubert import Hubert, export_hubert
from ico3d.speech.mel import MELS, WINDOW
from ico3d.speech.network import (
    AFTER,
    ATTENTION_WINDOW,
    BEFORE,
    CONTEXT,
    SPEECH_SIZE,
    AudioAttNet,
    AudioEncoder,
    BuiltinEncoder,
    ConvBlock,
    SequenceAdaptor,
    SpeechAdaptor,
)
from ico3d.speech.runtime import TOLD, served_name

_OPSET = 17
_IR_VERSION = 8
_HALF_FROM = 1024  # tensors of so many values are stored in half precision where that is exact
_TINY = 1e-20
"""Weights below it become 0. An attention that does not help decays to 1e-38 in training, where a
sum takes a processor thirty times as long and is 0 all the same."""
_ROWS = "rows"


def export_speech(adaptor: SpeechAdaptor, encoder: FrozenEncoder) -> bytes:
    """The contents of a bundle's `speech.onnx` (docs/bundle.md).

    Args:
        adaptor: The adaptor of this person's head.
        encoder: The encoder whose features the adaptor takes. The built-in encoder becomes part of
            the graph. Other encoders stay files of their own, which users install; the graph then
            takes their features as its input.

    Returns:
        An ONNX model from `mel` (T, 80, 16) or `features` (T, D) to `expression` (T, 32). Where the
        encoder's features tell the lips' articulation, it takes what is known of that, too: `told`
        (T, 6), five values and how far they count, 0 to 1; without that input nothing is known.
    """
    graph = _Graph()
    if encoder.name == "builtin":
        features = _encoder(graph, encoder.network, graph.input("mel", [_ROWS, MELS, WINDOW]))
        if encoder.articulation is not None:
            features = _corrected(graph, features, *encoder.articulation)
    else:
        features = graph.input("features", [_ROWS, encoder.size])
    return graph.model(_adaptor(graph, adaptor, features), "expression", SPEECH_SIZE)


def export_encoder(encoder: FrozenEncoder) -> bytes:
    """An ONNX model of an encoder: `mel` (T, 80, 16) or `sound` (1, SIZE) to `features` (T, D)."""
    if isinstance(encoder.network, Hubert):
        return export_hubert(encoder.network)
    graph = _Graph()
    mel = graph.input("mel", [_ROWS, MELS, WINDOW])
    return graph.model(_encoder(graph, encoder.network, mel), "features", encoder.size)


def make_servable(encoder: FrozenEncoder) -> Path:
    """Exports an encoder to where `served_encoder` finds the file, unless it exists.

    Returns:
        Path of the file; servers on other machines need a copy in their folder of weights.
    """
    name = served_name(encoder.name, encoder.sha256)
    found = find_model(name)
    if found is not None:
        return found
    path = model_folders()[-1] / name
    write_atomic(path, export_encoder(encoder))
    return path


class _Graph:
    """Collects nodes and weights; each method returns the name of what its node gives."""

    def __init__(self):
        try:
            import onnx
        except ImportError:
            raise MissingExtraError("onnx", "train", "writing speech.onnx") from None
        self._onnx = onnx
        self._nodes = []
        self._weights = []
        self._inputs = []
        self._count = 0

    def input(self, name: str, shape: list[int | str | None]) -> str:
        """Declares a float32 input."""
        kind = self._onnx.TensorProto.FLOAT
        self._inputs.append(self._onnx.helper.make_tensor_value_info(name, kind, shape))
        return name

    def told(self, width: int) -> str:
        """Declares the input `told` (T, width), which is a row of zeros unless it is given."""
        zeros = np.zeros((1, width), np.float32)
        self._weights.append(self._onnx.numpy_helper.from_array(zeros, TOLD))
        return self.input(TOLD, [None, width])

    def weight(self, value: torch.Tensor | np.ndarray) -> str:
        """Stores a constant."""
        array = value if isinstance(value, np.ndarray) else value.detach().cpu().numpy()
        array = np.where(np.abs(array) < _TINY, array.dtype.type(0), array)
        name = self._name()
        half = array.astype(np.float16) if array.dtype == np.float32 else array
        if array.size < _HALF_FROM or not np.array_equal(half, array):
            self._weights.append(self._onnx.numpy_helper.from_array(array, name))
            return name
        self._weights.append(self._onnx.numpy_helper.from_array(half, name))
        return self.add("Cast", name, to=self._onnx.TensorProto.FLOAT)

    def add(self, operator: str, *inputs: str, **attributes) -> str:
        """Adds a node."""
        name = self._name()
        node = self._onnx.helper.make_node(operator, list(inputs), [name], **attributes)
        self._nodes.append(node)
        return name

    def ints(self, *values: int) -> str:
        """Stores int64 values, as shapes and axes are."""
        return self.weight(np.array(values, np.int64))

    def linear(self, layer: nn.Linear, x: str) -> str:
        """A fully connected layer on rows (b, inputs)."""
        weight, bias = self.weight(layer.weight), self.weight(layer.bias)
        return self.add("Gemm", x, weight, bias, transB=1)

    def sequence(self, layers: nn.Sequential, x: str) -> str:
        """Linear layers, 1-D convolutions and leaky ReLUs, one after the other."""
        for layer in layers:
            if isinstance(layer, nn.Linear):
                x = self.linear(layer, x)
            elif isinstance(layer, nn.Conv1d):
                assert layer.bias is not None
                weight, bias = self.weight(layer.weight), self.weight(layer.bias)
                x = self.add("Conv", x, weight, bias, pads=[1, 1], strides=list(layer.stride))
            elif isinstance(layer, nn.LeakyReLU):
                x = self.add("LeakyRelu", x, alpha=layer.negative_slope)
            elif isinstance(layer, nn.Flatten):
                x = self.add("Flatten", x)
        return x

    def block(self, block: ConvBlock, x: str) -> str:
        """A convolution block with its normalisation folded in."""
        conv = block.conv_block[0]
        assert isinstance(conv, nn.Conv2d)
        weight, bias = (self.weight(value) for value in block.folded())
        y = self.add(
            "Conv",
            x,
            weight,
            bias,
            strides=list(conv.stride),
            dilations=list(conv.dilation),
            pads=[int(p) for p in conv.padding] * 2,
        )
        return self.add("Relu", self.add("Add", y, x) if block.residual else y)

    def model(self, result: str, name: str, width: int) -> bytes:
        """The finished model, whose output `name` is (T, width)."""
        helper = self._onnx.helper
        self._nodes.append(helper.make_node("Identity", [result], [name]))
        kind = self._onnx.TensorProto.FLOAT
        output = helper.make_tensor_value_info(name, kind, [_ROWS, width])
        graph = helper.make_graph(self._nodes, "speech", self._inputs, [output], self._weights)
        opset = [helper.make_opsetid("", _OPSET)]
        model = helper.make_model(graph, opset_imports=opset, ir_version=_IR_VERSION)
        self._onnx.checker.check_model(model)
        return model.SerializeToString()

    def _name(self) -> str:
        self._count += 1
        return f"v{self._count}"


def _encoder(graph: _Graph, network: nn.Module, mel: str) -> str:
    """Mel windows (T, 80, 16) to features (T, D)."""
    x = graph.add("Unsqueeze", mel, graph.ints(1))  # (T, 1, 80, 16)
    assert isinstance(network, BuiltinEncoder | AudioEncoder)
    blocks = network.blocks if isinstance(network, BuiltinEncoder) else network
    for block in blocks:
        assert isinstance(block, ConvBlock)
        x = graph.block(block, x)
    x = graph.add("Flatten", x)  # (T, channels)
    if isinstance(network, BuiltinEncoder):
        weight, bias = network.project.weight, network.project.bias
        assert bias is not None
        x = graph.add("Gemm", x, graph.weight(weight.flatten(1)), graph.weight(bias), transB=1)
    return x


def _corrected(graph: _Graph, features: str, weight: torch.Tensor, bias: torch.Tensor) -> str:
    """Features (T, D), moved as little as makes them tell the articulation that is known.

    Features tell a = W f + b. What is known is told instead by f + Wᵀ (W Wᵀ)⁻¹ (known − a).
    """
    count = len(bias)
    known = graph.told(count + 1)  # (T, 6) or (1, 6)
    columns = graph.ints(0), graph.ints(count), graph.ints(1)
    values = graph.add("Slice", known, *columns)  # (T, 5)
    columns = graph.ints(count), graph.ints(count + 1), graph.ints(1)
    part = graph.add("Slice", known, *columns)  # (T, 1)
    negative = graph.add("Gemm", features, graph.weight(-weight), graph.weight(-bias), transB=1)
    missing = graph.add("Mul", graph.add("Add", values, negative), part)  # (T, 5)
    back = torch.linalg.pinv(weight)  # (D, 5)
    moved = graph.add("MatMul", missing, graph.weight(back.T.contiguous()))  # (T, D)
    return graph.add("Add", features, moved)


def _adaptor(graph: _Graph, network: SpeechAdaptor, features: str) -> str:
    """Features (T, D) to expressions (T, 32)."""
    padded = graph.add("Pad", features, graph.ints(BEFORE, 0, AFTER, 0))  # (T + 7, D)
    lips = _lips(graph, network, padded) if network.lips.any() else None
    if isinstance(network.adaptor, SequenceAdaptor):
        padded = _vectors(graph, padded, network.size, network.vectors)  # (T + 7, D / v, v)
    adapted = graph.sequence(network.adaptor, padded)  # (T + 7, 32)
    shifted = []
    for offset in range(ATTENTION_WINDOW):
        row = _shifted(graph, adapted, offset)  # (T, 32)
        shifted.append(graph.add("Unsqueeze", row, graph.ints(2)))  # (T, 32, 1)
    windows = graph.add("Concat", *shifted, axis=2)  # (T, 32, 8)
    expression = _attention(graph, network.attention, windows)
    return expression if lips is None else graph.add("Add", expression, lips)


def _lips(graph: _Graph, network: SpeechAdaptor, padded: str) -> str:
    """Features with rows around, (T + 7, D), to what they tell about the lips, (T, 32)."""
    near = []
    for offset in range(BEFORE - CONTEXT, BEFORE + CONTEXT + 1):
        near.append(_shifted(graph, padded, offset))  # (T, D)
    rows = graph.add("Concat", *near, axis=1)  # (T, 5 · D)
    weight, rest = graph.weight(network.lips), graph.weight(network.lips_rest)
    return graph.add("Gemm", rows, weight, rest, transB=1)


def _shifted(graph: _Graph, rows: str, offset: int) -> str:
    """Rows `offset` to `offset` + T − 1 of (T + 7, C)."""
    last = offset - ATTENTION_WINDOW + 1
    end = graph.ints(last if last else np.iinfo(np.int64).max)
    return graph.add("Slice", rows, graph.ints(offset), end, graph.ints(0))


def _vectors(graph: _Graph, features: str, size: int, vectors: int) -> str:
    """Features (T, D), one vector after the other, to (T, D / vectors, vectors)."""
    parts, step = [], size // vectors
    for first in range(0, size, step):
        bounds = graph.ints(first), graph.ints(first + step), graph.ints(1)
        part = graph.add("Slice", features, *bounds)  # (T, D / v)
        parts.append(graph.add("Unsqueeze", part, graph.ints(2)))
    return graph.add("Concat", *parts, axis=2)


def _attention(graph: _Graph, network: AudioAttNet, windows: str) -> str:
    """Windows (T, 32, 8) to their weighted means (T, 32)."""
    scores = graph.add("Flatten", graph.sequence(network.convolutions, windows))  # (T, 8)
    weights = graph.add("Softmax", graph.linear(network.scores, scores), axis=1)  # (T, 8)
    weights = graph.add("Unsqueeze", weights, graph.ints(1))  # (T, 1, 8)
    weighted = graph.add("Mul", windows, weights)  # (T, 32, 8)
    return graph.add("ReduceSum", weighted, graph.ints(2), keepdims=0)
