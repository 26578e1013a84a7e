"""HuBERT (Hsu et al. 2021) as a speech encoder, through transformers (torch)."""

import io
import os
import warnings
from pathlib import Path
from typing import Any

import torch
from torch import nn

from ico3d.common.unpacking.heads import check_head
from ico3d.common.unpacking.weights import check_unpacked
from ico3d.errors import MissingExtraError, ModelError
from ico3d.speech.blocks import PAST, ROWS, SIZE

VECTORS = 2
"""HuBERT gives 50 vectors per second; two are concatenated to a row, as in SyncTalk."""

WEIGHTS = ("model.safetensors", "pytorch_model.bin")
"""Files of weights in a folder of transformers, the preferred one first."""


class Hubert(nn.Module):
    """Maps windows of sound (b, SIZE) to the features (b, 5, 2·H) of their inner rows.

    Attributes:
        size: 2·H, where H is HuBERT's hidden size.
        model: The `transformers.HubertModel`.
    """

    def __init__(self, model: nn.Module):
        """Takes a `transformers.HubertModel`."""
        super().__init__()
        self.size = VECTORS * int(model.config.hidden_size)  # type: ignore[union-attr]
        self.model = model

    def forward(self, sound: torch.Tensor) -> torch.Tensor:
        """Windows (b, SIZE) to features (b, 5, 2·H)."""
        vectors = self.model(sound).last_hidden_state  # (b, 60, H)
        return vectors.unflatten(1, (-1, VECTORS)).flatten(2)[:, PAST : PAST + ROWS]


def load_network(folder: Path) -> Hubert:
    """Loads HuBERT from a folder of transformers: `config.json` and weights.

    Raises:
        MissingExtraError: If transformers is not installed.
        ModelError: If the folder holds no HuBERT model.
    """
    try:
        from transformers import HubertModel
    except ImportError:
        raise MissingExtraError("transformers", "hubert", "the speech encoder 'hubert'") from None
    weights = weight_file(folder)
    try:
        if weights.suffix == ".safetensors":
            check_head(weights)
        else:
            check_unpacked(weights)
        loaded: Any = HubertModel.from_pretrained(
            folder, local_files_only=True, output_loading_info=True, weights_only=True
        )
    except Exception as error:  # of many kinds, from several packages
        reason = str(error).strip().split("\n")[0]
        raise ModelError(f"{folder} does not hold HuBERT: {reason}") from None
    model, about = loaded
    missing = sorted(about["missing_keys"])
    if missing:  # they would be random
        raise ModelError(f"{folder} does not hold HuBERT: it lacks {missing[0]}.")
    if model.config.conv_stride[0] != 5 or model.config.num_feat_extract_layers != 7:
        raise ModelError(f"{folder} holds a HuBERT that does not give 50 vectors per second.")
    return Hubert(model)


def weight_file(folder: Path) -> Path:
    """Path of the file of weights in a folder of transformers.

    Raises:
        ModelError: If the folder has no such file.
    """
    found = next((folder / name for name in WEIGHTS if os.path.isfile(folder / name)), None)
    if found is None:
        raise ModelError(f"{folder} holds no weights: neither {WEIGHTS[0]} nor {WEIGHTS[1]}.")
    return found


def export_hubert(network: Hubert) -> bytes:
    """An ONNX model of HuBERT, from `sound` (1, SIZE) to `features` (5, 2·H)."""
    file = io.BytesIO()
    with warnings.catch_warnings():
        # The newer exporter needs a further package and takes 15 times as long for the same graph.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            nn.Sequential(network, nn.Flatten(0, 1)).eval(),
            (torch.zeros(1, SIZE),),
            file,  # type: ignore[arg-type]
            dynamo=False,
            opset_version=17,
            input_names=["sound"],
            output_names=["features"],
        )
    return file.getvalue()
