// Written by `python -m ico3d.chat.generating` from the files of `src/ico3d` named.

/** What a manifest calls itself; bundle/manifest.py. */
export const BUNDLE_FORMAT = "ico3d-bundle";

/** The newest version of a manifest. */
export const BUNDLE_VERSION = 7;

/** The oldest version that is read. */
export const OLDEST_BUNDLE = 1;

/** Of a head or a window of a body; bundle/limits.py. */
export const MAX_GAUSSIANS = 1000000;

/** What SPZ files may unpack to, and their highest degree; common/spz/container.py. */
export const SPZ = {"ratio": 8, "free": 262144, "degree": 3} as const;

/** What else a bundle may have: a head's counts, a body's frames, files and their bytes. */
export const MOST = {"rank": 64, "blended": 8388608, "moved": 4194304, "body_rank": 16, "samples_per_frame": 8, "displacements": 16, "eye_turn": 0.5, "hidden": 1024, "expression_size": 512, "num_poses": 100000, "window_frames": 1000, "posed_frames": 30000, "known_poses": 256, "files": 256, "file_bytes": 268435456, "bundle_bytes": 536870912, "manifest_bytes": 1048576} as const;

/** Most bytes of files that may be less large than others, by name. */
export const SMALLER = {"animation.json": 1048576, "body/gestures.safetensors": 4194304, "background.spz": 67108864, "background.ply": 67108864} as const;

/** Metres per radian of a unit of what turns a head's eyes. */
export const EYE_UNIT = 0.000125;

/** Width of the network of a head's displacements. */
export const MOVE_HIDDEN = 64;

/** Residual shapes of a body on a skeleton. */
export const MAX_SHAPES = 8;

/** Of a body's skeleton; rig/rig.py. */
export const MAX_JOINTS = 256;

/** Groups of Gaussians in a window that move alike. */
export const MAX_CLUSTERS = 256;

/** Spheres that cast its shadow. */
export const MAX_CASTERS = 20000;

/** The map in which a lamp sees a body, in metres; rig/shadow_map.py. */
export const SHADOW = {"radius": 0.02, "texel": 0.0125, "side": 256, "off": 0.01, "bias": 0.03, "edge": 0.002, "wrap": 0.2} as const;

/** Sentences of earlier visits; chat/wire/protocol_visits.py. */
export const MAX_NOTES = 16;

/** Characters of each. */
export const MAX_NOTE = 200;

/** Of a head's networks; common/expression.py. */
export const LEAKY_SLOPE = 0.02;

/** The eyelids among blendshapes. */
export const LID_NAMES = ["eyeBlinkLeft", "eyeBlinkRight"] as const;

/** Their places in the eye and brow values; common/expression.py. */
export const LIDS = [5, 6] as const;

/** How a person blinks, in s; `spread` of the pauses' logarithms. Sources: speech/eyes.py. */
export const BLINK = {"closing": 0.07, "closed": 0.03, "opening": 0.1, "median": 3.4, "spread": 0.35, "shortest": 2.0, "longest": 6.0} as const;

/** What joints are to gestures; motion/roles.py. */
export const ROLES = ["hips", "spine", "chest", "neck", "head", "left_clavicle", "left_shoulder", "left_elbow", "left_wrist", "left_thumb1", "left_thumb2", "left_thumb3", "left_index1", "left_index2", "left_index3", "left_middle1", "left_middle2", "left_middle3", "left_ring1", "left_ring2", "left_ring3", "left_little1", "left_little2", "left_little3", "right_clavicle", "right_shoulder", "right_elbow", "right_wrist", "right_thumb1", "right_thumb2", "right_thumb3", "right_index1", "right_index2", "right_index3", "right_middle1", "right_middle2", "right_middle3", "right_ring1", "right_ring2", "right_ring3", "right_little1", "right_little2", "right_little3", "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle"] as const;

/** The number of each role's parent; -1 for the hips. */
export const ROLE_PARENTS = [-1, 0, 1, 2, 3, 2, 5, 6, 7, 8, 9, 10, 8, 12, 13, 8, 15, 16, 8, 18, 19, 8, 21, 22, 2, 24, 25, 26, 27, 28, 29, 27, 31, 32, 27, 34, 35, 27, 37, 38, 27, 40, 41, 0, 43, 44, 0, 46, 47] as const;

/** Between a question and its answer, in order; observing/timing.py. */
export const LATENCY_PARTS = ["vad", "turn", "token", "clause", "voice", "expression", "send"] as const;
