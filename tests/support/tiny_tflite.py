"""TensorFlow Lite models of a few hundred bytes, laid out as MediaPipe's: a picture in, numbers
out, random weights.
"""

import io
import zipfile
from importlib import import_module

import numpy as np


def write_model(seed: int, outputs: int = 2, files: dict[str, bytes] | None = None) -> bytes:
    """A model without metadata.

    Args:
        seed: Of its weights.
        outputs: How many numbers come out, each a tensor.
        files: What lies behind it as a zip, such as labels.
    """
    flatbuffers = import_module("flatbuffers")
    schema = import_module("mediapipe.tasks.metadata.schema_py_generated")
    weights = schema.BufferT()
    weights.data = np.random.default_rng(seed).integers(0, 256, 200, np.uint8)
    shapes = {"picture": [1, 8, 8, 3], **{f"out{n}": [1] for n in range(outputs)}, "w": [50]}
    graph = schema.SubGraphT()
    graph.tensors = []
    for name, shape in shapes.items():
        tensor = schema.TensorT()
        tensor.name, tensor.shape, tensor.buffer = name, shape, int(name == "w")
        tensor.type = schema.TensorType.FLOAT32
        graph.tensors.append(tensor)
    graph.inputs, graph.outputs = [0], list(range(1, outputs + 1))
    model = schema.ModelT()
    model.version, model.subgraphs = 3, [graph]
    model.buffers = [schema.BufferT(), weights]
    builder = flatbuffers.Builder(0)
    builder.Finish(model.Pack(builder), b"TFL3")
    whole = io.BytesIO(builder.Output())
    if files:
        with zipfile.ZipFile(whole, "a") as archive:
            for name, data in files.items():
                archive.writestr(name, data)
    return whole.getvalue()


def read_model(data: bytes) -> tuple[np.ndarray, tuple[float, float]]:
    """A model's weights, and mean and deviation of the picture as its metadata has them."""
    schema = import_module("mediapipe.tasks.metadata.schema_py_generated")
    metadata = import_module("mediapipe.tasks.metadata.metadata_schema_py_generated")
    model = schema.ModelT.InitFromObj(schema.Model.GetRootAsModel(data, 0))
    (entry,) = [entry for entry in model.metadata if entry.name == b"TFLITE_METADATA"]
    packed = bytes(model.buffers[entry.buffer].data)
    assert metadata.ModelMetadata.ModelMetadataBufferHasIdentifier(packed, 0)
    told = metadata.ModelMetadataT.InitFromObj(metadata.ModelMetadata.GetRootAs(packed, 0))
    (graph,) = told.subgraphMetadata
    (picture,) = graph.inputTensorMetadata
    assert len(graph.outputTensorMetadata) == len(model.subgraphs[0].outputs)
    (unit,) = picture.processUnits
    assert unit.optionsType == metadata.ProcessUnitOptions.NormalizationOptions
    return model.buffers[1].data, (float(unit.options.mean[0]), float(unit.options.std[0]))
