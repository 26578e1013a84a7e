import { LEAKY_SLOPE } from '../shared.ts';
import type { Network } from '../bundle/baked-head.ts';

/**
 * The outputs of a head's network for an expression: c(e) = LeakyReLU(e·w1 + b1)·w2 + b2.
 *
 * @param expression (B,)
 * @param out (K,) receives the coefficients
 */
export function coefficients(network: Network, expression: Float32Array, out: Float32Array): void {
  const { inputs, hidden, outputs, w1, b1, w2, b2 } = network;
  out.set(b2);
  for (let h = 0; h < hidden; h++) {
    let sum = b1[h]!;
    for (let b = 0; b < inputs; b++) sum += expression[b]! * w1[b * hidden + h]!;
    const active = sum < 0 ? LEAKY_SLOPE * sum : sum;
    for (let k = 0; k < outputs; k++) out[k]! += active * w2[h * outputs + k]!;
  }
}
