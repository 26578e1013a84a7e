import { SHADOW } from '../../shared.ts';
import type { BakedSky } from './baked.ts';
import type { Casters } from './casters.ts';
import { axesOf } from './shadow.ts';

const TURN = Math.PI * (3 - Math.sqrt(5)); // from one direction to the next, about z
const NONE = 1e-6; // light that is there at least, to be a share of

/** How much of the light from all around reaches each Gaussian in a pose: the body hides it from itself. */
export class Sky {
  readonly shares: Float32Array; // (N,) up to 1
  private readonly casters: Casters;
  private readonly axes: Float64Array[]; // (3,3) of each direction
  private readonly seen: Float64Array; // (M,) share that reaches the skin above the spheres
  private readonly parts: BakedSky[] = []; // of the Gaussians that have come

  /**
   * @param count number of directions
   * @param room number of Gaussians that may come
   */
  constructor(casters: Casters, count: number, room: number) {
    this.casters = casters;
    this.axes = spiral(count).map(axesOf);
    this.seen = new Float64Array(casters.open.length).fill(1);
    this.shares = new Float32Array(room);
  }

  /** Takes the next Gaussians. */
  add(part: BakedSky): void {
    this.parts.push(part);
    this.spread();
  }

  /** Looks around from the skin above each sphere as they lie now. */
  look(): void {
    const { casters, seen } = this;
    const { open, whole } = casters;
    open.fill(0);
    whole.fill(NONE);
    for (const axes of this.axes) {
      casters.draw(axes);
      casters.gather();
    }
    for (let i = 0; i < seen.length; i++) seen[i] = Math.max(open[i]! / whole[i]!, SHADOW.skyLeast);
    this.spread();
  }

  /** Writes the shares of all Gaussians from those of the spheres about them. */
  private spread(): void {
    const { seen, shares } = this;
    let at = 0;
    for (const { casters, weights } of this.parts) {
      for (let k = 0; k < casters.length; k += 4) {
        const first = weights[k]! * seen[casters[k]!]! + weights[k + 1]! * seen[casters[k + 1]!]!;
        shares[at++] = (first + weights[k + 2]! * seen[casters[k + 2]!]! + weights[k + 3]! * seen[casters[k + 3]!]!) / 255;
      }
    }
  }
}

/** Unit vectors (3,) all around, evenly spread (Fibonacci's spiral), as `directions` of `common/spread.py`. */
export function spiral(count: number): [number, number, number][] {
  return Array.from({ length: count }, (_, i) => {
    const along = 1 - (2 * i) / (count - 1);
    const across = Math.sqrt(1 - along * along);
    return [across * Math.cos(i * TURN), across * Math.sin(i * TURN), along];
  });
}
