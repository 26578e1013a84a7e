// Written by `python -m ico3d.chat.generating` from the files of `src/ico3d` named.

/** What a manifest calls itself; bundle/manifest.py. */
export const BUNDLE_FORMAT = "ico3d-bundle";

/** The newest version of a manifest. */
export const BUNDLE_VERSION = 3;

/** The oldest version that is read. */
export const OLDEST_BUNDLE = 1;

/** Of a head or a window of a body; bundle/limits.py. */
export const MAX_GAUSSIANS = 1000000;

/** Residual shapes of a body on a skeleton. */
export const MAX_SHAPES = 8;

/** Of a body's skeleton; rig/rig.py. */
export const MAX_JOINTS = 256;

/** Groups of Gaussians in a window that move alike. */
export const MAX_CLUSTERS = 256;

/** Of a head's coefficients; bundle/evaluate.py. */
export const LEAKY_SLOPE = 0.02;

/** The eyelids among blendshapes. */
export const LID_NAMES = ["eyeBlinkLeft", "eyeBlinkRight"] as const;

/** Their places in the eye and brow values; common/expression.py. */
export const LIDS = [5, 6] as const;

/** How a person blinks, in s; `spread` of the pauses' logarithms. Sources: speech/eyes.py. */
export const BLINK = {"closing": 0.07, "closed": 0.03, "opening": 0.1, "median": 3.4, "spread": 0.35, "shortest": 2.0, "longest": 6.0} as const;

/** Between a question and its answer, in order; observing/timing.py. */
export const LATENCY_PARTS = ["vad", "turn", "token", "clause", "voice", "expression", "send"] as const;
