"""The sentences of advice in English, by code: what it is about, before a hyphen what of it.

The studio page has each of them in its languages, as `studio.advice.CODE`.
"""

TEXTS: dict[str, str] = {
    "blur": "the face is blurred: wipe the lens, give it light and time to focus, move slowly.",
    "camera": (
        "the camera or the background moves: put the phone or laptop on something firm, and let "
        "nobody walk behind you."
    ),
    "distance": (
        "the face is small, {share} % of the picture's short side: come closer until it fills "
        "{least} to 50 %."
    ),
    "exposure": (
        "the brightness changes: lock the exposure (on phones: hold a finger on the face), and let "
        "no screen or passing cloud be the light."
    ),
    "face-away": "no face is seen: look towards the camera, and stay in the picture.",
    "face-dark": (
        "no face is found: film one real person who looks towards the camera, at arm's length, "
        "without a mask. The pictures are dark: turn on the light."
    ),
    "face-none": (
        "no face is found: film one real person who looks towards the camera, at arm's length, "
        "without a mask."
    ),
    "faces": (
        "two faces are seen: film one person alone, and cover pictures and mirrors in which faces "
        "are seen."
    ),
    "file": "the file is damaged: {n} parts of it cannot be read; copy it again.",
    "frame": (
        "the face is cut off by the edge: keep all of the head in the picture, with room above it."
    ),
    "hands": "a hand is before the face: keep hands down, what they hide is never learnt.",
    "length-few": (
        "the video lasts {seconds} s: half a minute or more shows more sounds and sides."
    ),
    "length-short": "the video lasts {seconds} s: film half a minute or more of talking.",
    "light-dark": "the face is dark: sit facing a window or a lamp, not with your back to it.",
    "light-none": "it is too dark to see the face: turn on the light, face a window.",
    "light-white": "parts of the face are white: dim the light, or move away from it.",
    "lips-photograph": (
        "nothing moves in the face, as in a photograph: film yourself while you talk and turn your "
        "head."
    ),
    "lips-still": "the lips hardly move: read something aloud.",
    "rate-gaps": "the picture stands still: close other programs while filming.",
    "rate-slow": (
        "there are {n} pictures per second: give more light, or choose 25 or 30 in the camera's "
        "settings."
    ),
    "short-down": "turn the head further down: it was turned by {n}°, and {goal}° are enough.",
    "short-left": (
        "turn the head further to the left: it was turned by {n}°, and {goal}° are enough."
    ),
    "short-right": (
        "turn the head further to the right: it was turned by {n}°, and {goal}° are enough."
    ),
    "short-up": "turn the head further up: it was turned by {n}°, and {goal}° are enough.",
    "sound-clipped": "the sound is clipped: speak softer, or move away from the microphone.",
    "sound-noise": (
        "noise is nearly as loud as the voice, or there is no pause: find a quiet room, and be "
        "silent for a moment between sentences."
    ),
    "sound-none": (
        "the video has no sound, by which an avatar learns how your lips follow your voice: film "
        "again with the microphone on."
    ),
    "sound-quiet": "the voice is quiet: speak up, or come closer.",
    "sound-silent": (
        "the sound is silent, and an avatar learns from it how your lips follow your voice: switch "
        "the microphone on and film again."
    ),
    "turns-sides": (
        "the head turns to the sides by {n}° in all: look slowly to the sides while you talk, as "
        "the avatar is blurred where it was not seen."
    ),
    "turns-up": (
        "the head turns up and down by {n}° in all: look slowly up and down while you talk, as the "
        "avatar is blurred where it was not seen."
    ),
    "voice-failed": "the avatar is made without a voice of its own: cloning it did not work here.",
    "voice-lacking": (
        "the avatar is made without a voice of its own: OpenVoice, which imitates voices, is not "
        "installed here, or not all of it."
    ),
    "voice-noisy": (
        "the avatar is made without a voice of its own: {n} s of speech are free of noise and "
        "clipping, and {least} s are needed: find a quiet room, and do not come too close to the "
        "microphone."
    ),
    "voice-none": "the avatar is made without a voice of its own: the recording has no sound.",
    "voice-short": (
        "the avatar is made without a voice of its own: {n} s of speech are heard, and {least} s "
        "are needed: talk more."
    ),
    "voice-silent": "the avatar is made without a voice of its own: the recording is silent.",
}
