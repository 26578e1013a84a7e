/**
 * How long tests wait at most for what must come, ms: a machine with other work is slow, not wrong.
 * It is less than a test may take, so that what did not come has a name.
 */
export const PATIENCE = 100_000;
