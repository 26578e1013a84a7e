"""Writes bundles for MediaPipe's Tasks API from TensorFlow Lite models.

MediaPipe refuses models whose metadata does not say how pictures are normalised. MediaPipe has its
own writer for such metadata, but newer versions cannot import it, because they no longer ship a
compiled part of it. The parts of that writer that can still be imported are used here; the metadata
written is the same.
"""

import io
from importlib import import_module
from pathlib import Path
from typing import Any
from zipfile import ZipFile, ZipInfo, is_zipfile

from ico3d.errors import MissingExtraError

_METADATA = "TFLITE_METADATA"
_MODEL_KIND, _METADATA_KIND = b"TFL3", b"M001"  # identifiers of flatbuffers
_ALIGNMENT = 4  # bytes, where a model begins: MediaPipe maps it into memory
_PARSER = "1.0.0"  # the oldest parser of metadata that knows all fields used here


def write_bundle(path: Path, models: dict[str, bytes]) -> None:
    """Writes models as one file that MediaPipe's Tasks API opens.

    Equal models give equal bytes.

    Args:
        path: The bundle to write.
        models: Contents of the models, by their names in the bundle.

    Raises:
        MissingExtraError: If MediaPipe is not installed.
    """
    utilities = mediapipe_tasks("python.metadata.metadata_writers.model_asset_bundle_utils")
    with utilities.AlignZipFile(path, mode="w", alignment=_ALIGNMENT) as bundle:
        for name, model in models.items():
            bundle.writestr(ZipInfo(name), model)


def with_normalisation(model: bytes, name: str, mean: float, deviation: float) -> bytes:
    """Adds metadata to a model that says how its input pictures are normalised.

    Args:
        model: A TensorFlow Lite model whose only input is a picture; its old metadata is replaced.
        name: The model's name in the metadata, for people.
        mean: Number subtracted from pixel values (0 to 255): the input is (value − mean) /
            deviation.
        deviation: Number by which pixel values are divided after `mean` was subtracted.

    Returns:
        The model's new contents.

    Raises:
        MissingExtraError: If MediaPipe is not installed.
    """
    schema = mediapipe_tasks("metadata.schema_py_generated")
    tree = schema.ModelT.InitFromObj(schema.Model.GetRootAsModel(model, 0))
    buffer = schema.BufferT()
    buffer.data = _metadata(model, name, mean, deviation)
    entries: list[Any] = tree.metadata or []
    known = next((entry for entry in entries if entry.name == _METADATA.encode()), None)
    if known is not None:
        tree.buffers[known.buffer] = buffer
    else:
        tree.buffers.append(buffer)
        entry = schema.MetadataT()
        entry.name, entry.buffer = _METADATA, len(tree.buffers) - 1
        tree.metadata = [*entries, entry]
    return _with_files_of(model, _flat(tree, _MODEL_KIND))


def mediapipe_tasks(module: str) -> Any:
    """Imports a module of MediaPipe's Tasks API; the module has no type hints.

    Args:
        module: The module's name without the prefix `mediapipe.tasks.`.

    Returns:
        The imported module.

    Raises:
        MissingExtraError: If MediaPipe is not installed.
    """
    try:
        return import_module(f"mediapipe.tasks.{module}")
    except ImportError:
        raise MissingExtraError("mediapipe", "face", "packing models for MediaPipe") from None


def _metadata(model: bytes, name: str, mean: float, deviation: float) -> bytes:
    """Metadata as MediaPipe's own writer makes it for one picture and plain outputs."""
    schema = mediapipe_tasks("metadata.metadata_schema_py_generated")
    parts = mediapipe_tasks("python.metadata.metadata_writers.metadata_info")
    reader = mediapipe_tasks("python.metadata.metadata_writers.writer_utils")
    picture = parts.InputImageTensorMd(
        "image",
        "Input image to be processed.",
        [mean],
        [deviation],
        schema.ColorSpaceType.RGB,
        reader.get_input_tensor_types(bytearray(model))[0],
    )
    outputs = reader.get_output_tensor_names(bytearray(model))
    output = schema.TensorMetadataT()
    output.name = outputs[0]  # MediaPipe's writer gives all outputs the first one's name, too
    graph = schema.SubGraphMetadataT()
    graph.inputTensorMetadata = [picture.create_metadata()]
    graph.outputTensorMetadata = [output] * len(outputs)
    whole = parts.GeneralMd(name=name, description="").create_metadata()
    whole.subgraphMetadata = [graph]
    whole.minParserVersion = _PARSER
    return _flat(whole, _METADATA_KIND)


def _flat(tree: Any, kind: bytes) -> bytes:
    """A tree of objects as a flatbuffer."""
    builder = import_module("flatbuffers").Builder(0)  # comes with MediaPipe
    builder.Finish(tree.Pack(builder), kind)
    return bytes(builder.Output())


def _with_files_of(model: bytes, changed: bytes) -> bytes:
    """A changed model with the files, such as labels, that lie as a zip behind the original."""
    whole = io.BytesIO(changed)
    with ZipFile(whole, "a") as target:
        if is_zipfile(io.BytesIO(model)):
            with ZipFile(io.BytesIO(model)) as source:
                for info in source.infolist():
                    target.writestr(info, source.read(info))
    return whole.getvalue()
