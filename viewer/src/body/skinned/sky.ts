import { SHADOW } from '../../shared.ts';
import type { BakedSky } from './baked.ts';
import type { Casters } from './casters.ts';
import { ShadowMap } from './shadow.ts';

const OUT = SHADOW.radius + SHADOW.off; // metres from a sphere's centre to where its light is looked for
const TURN = Math.PI * (3 - Math.sqrt(5)); // from one direction to the next, about z

/** How much of the light from all around reaches each Gaussian in a pose: its spheres hide it from each other. */
export class Sky {
  readonly shares: Float32Array; // (N,) from SHADOW.skyLeast to 1
  private readonly casters: Casters;
  private readonly directions: Float64Array; // (D,3)
  private readonly maps: ShadowMap[]; // of the directions, which share their room
  private readonly open: Float64Array; // (M,) of the spheres
  private readonly whole: Float64Array; // (M,) light that would reach them without the others

  /** @param room for the Gaussians, of which there are at most so many */
  constructor(casters: Casters, directions: number, room: number) {
    const spheres = casters.centres.length / 3;
    this.casters = casters;
    this.directions = spiral(directions);
    const depths = new Float32Array(SHADOW.side ** 2);
    this.maps = Array.from({ length: directions }, (_, i) => new ShadowMap(this.directions.subarray(3 * i, 3 * i + 3), depths));
    this.open = new Float64Array(spheres);
    this.whole = new Float64Array(spheres);
    this.shares = new Float32Array(room);
  }

  /** Looks around from each sphere as they lie now. */
  look(): void {
    const { casters, maps, open, whole } = this;
    open.fill(0);
    whole.fill(0);
    for (const map of maps) {
      map.draw(casters.centres);
      this.gather(map);
    }
    for (let i = 0; i < open.length; i++) open[i] = whole[i]! > 0 ? Math.max(SHADOW.skyLeast, open[i]! / whole[i]!) : 1;
  }

  /** Adds the light from where a map was drawn. */
  private gather(map: ShadowMap): void {
    const { open, whole, casters: { centres, normals } } = this;
    const [dx, dy, dz] = [map.axes[6]!, map.axes[7]!, map.axes[8]!];
    for (let i = 0, at = 0; i < open.length; i++, at += 3) {
      const x = normals[at]!;
      const y = normals[at + 1]!;
      const z = normals[at + 2]!;
      const cosine = x * dx + y * dy + z * dz;
      if (!(cosine > 0)) continue;
      whole[i]! += cosine;
      open[i]! += cosine * map.reach(centres[at]! + OUT * x, centres[at + 1]! + OUT * y, centres[at + 2]! + OUT * z);
    }
  }

  /** Writes the shares of Gaussians from number `begin` on. */
  spread({ casters, weights }: BakedSky, begin: number): void {
    const { open, shares } = this;
    for (let k = 0; k < casters.length; k += 4) {
      const sum = weights[k]! * open[casters[k]!]! + weights[k + 1]! * open[casters[k + 1]!]!;
      shares[begin + k / 4] = (sum + weights[k + 2]! * open[casters[k + 2]!]! + weights[k + 3]! * open[casters[k + 3]!]!) / 255;
    }
  }
}

/** Directions (count,3) all around, evenly spread (Fibonacci's spiral). */
export function spiral(count: number): Float64Array {
  const directions = new Float64Array(3 * count);
  for (let i = 0; i < count; i++) {
    const along = 1 - (2 * i) / (count - 1);
    const across = Math.sqrt(1 - along * along);
    directions.set([across * Math.cos(i * TURN), across * Math.sin(i * TURN), along], 3 * i);
  }
  return directions;
}
