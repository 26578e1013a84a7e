"""What can end the making of an avatar, in English, by code: what happened, and what helps.

A terminal shows each sentence amid what matters there alone, such as the name of a file
(`Ico3dError.of`). The studio page has each of them in its languages, as `studio.failure.CODE`.
"""

FAILURES: dict[str, str] = {
    "busy": "the avatar is being made just now, by another process.",
    "checkpoint": "all checkpoints of the training are damaged: it cannot go on from there.",
    "costly": "reading the video takes more time or memory than is given to it: convert it to MP4.",
    "decoding": "the file cannot be decoded as a video; is it damaged?",
    "disk-full": "the disk is full: free some space.",
    "disk-room": "the disk has {free} GB left and {needed} GB are needed: free some space.",
    "diverged": "learning has diverged, as with damaged pictures.",
    "ended": "the making has ended unexpectedly: begin again, it goes on where it was.",
    "faceless": (
        "no face is found in any of the {n} pictures: film one person who looks towards the camera."
    ),
    "faded": "the face has faded away by step {step} of learning.",
    "gone": "there is no video file.",
    "gpu-failed": "the GPU failed at step {step}.",
    "gpu-memory": "the GPU's memory ran out at step {step}: end other programs that use the GPU.",
    "kind": "the video is of a kind that cannot be decoded here.",
    "killed": (
        "the making was killed, as happens where memory runs out: end other programs, and begin "
        "again; it goes on where it was."
    ),
    "long": "the video is longer than {n} s.",
    "memory": "this machine's memory ran out: end other programs, and begin again.",
    "model": "the model file '{file}' is not installed.",
    "no-picture": "no picture can be decoded; is the file damaged?",
    "nothing": "there is no recording: record some parts, or choose a video.",
    "photograph": (
        "a photograph: one picture shows neither the sides of a head nor how its mouth moves with "
        "the voice; film yourself talking for half a minute, and give that video."
    ),
    "shape": (
        "{part} has another shape than {first}: record it again, with the camera held as before."
    ),
    "streamless": "the file holds no video stream.",
}
