import { dyno, SplatMesh } from '@sparkjsdev/spark';
import type { Vector3 } from 'three';
import type { Actor } from '../actor.ts';
import type { BundleFiles } from '../bundle/load.ts';
import { PageError } from '../errors.ts';
import { makeRows, ROW_BYTES, type SoftObject, type Source } from '../soft/source.ts';

const LEAST = 1e-9; // m, of a scale
const HASH = 2654435769;
const APART = 1e-3; // by which splats of one size differ, each by a share of its own: else all of them would go at once

/** The splats behind the person, which stand still. */
class Backdrop implements Actor {
  readonly objects: SplatMesh[];
  private readonly mesh: SplatMesh;
  private readonly sizes: Float32Array; // m², in rising order
  private readonly least: { value: number }; // m², of those that are drawn
  private readonly soft: SoftBackdrop;

  /** @param least as the mesh's modifier reads it */
  constructor(mesh: SplatMesh, least: { value: number }) {
    this.mesh = mesh;
    this.objects = [mesh];
    this.least = least;
    this.soft = Object.assign(mesh, { soft: new SoftBackdrop(mesh) }).soft;
    const sizes: number[] = [];
    mesh.forEachSplat((index, _, scales, __, opacity) => sizes.push(sizeOf(index, scales, opacity)));
    this.sizes = Float32Array.from(sizes).sort();
  }

  tick(): boolean {
    return false;
  }

  thin(share: number): void {
    const index = Math.floor((1 - share) * this.sizes.length);
    this.least.value = index > 0 ? this.sizes[index]! : 0;
    this.mesh.updateVersion();
    this.soft.thin(share);
  }
}

/** Opacity times the two larger scales, m². */
function sizeOf(index: number, { x, y, z }: Vector3, opacity: number): number {
  return ((opacity * x * y * z) / Math.max(LEAST, Math.min(x, y, z))) * (1 + (APART * (Math.imul(index, HASH) >>> 8)) / 2 ** 24);
}

/** The splats for the processor's path, the largest ones first; seen from everywhere in the colour of their mean. */
class SoftBackdrop implements SoftObject {
  drawn: number;
  readonly values = new Float32Array(0);
  private readonly mesh: SplatMesh;
  private packed: Source | null = null;

  constructor(mesh: SplatMesh) {
    this.mesh = mesh;
    this.drawn = mesh.numSplats;
  }

  get source(): Source {
    return (this.packed ??= pack(this.mesh));
  }

  thin(share: number): void {
    this.drawn = Math.ceil(share * this.mesh.numSplats);
  }
}

function pack(mesh: SplatMesh): Source {
  const splats: { size: number; row: number[] }[] = [];
  mesh.forEachSplat((index, centre, scales, { x, y, z, w }, opacity, { r, g, b }) => {
    const row = [...centre.toArray(), w, x, y, z, ...scales.toArray(), r, g, b, opacity];
    splats.push({ size: sizeOf(index, scales, opacity), row });
  });
  splats.sort((a, b) => b.size - a.size);
  const { rows, floats } = makeRows(splats.length, ROW_BYTES.still);
  for (const [i, { row }] of splats.entries()) floats.set(row, (i * ROW_BYTES.still) / 4);
  return { kind: 'still', count: splats.length, rows, sizes: [] };
}

/** Fetches the splats behind the person, if the bundle has some. */
export async function makeBackdrop(files: BundleFiles): Promise<Actor | null> {
  const splats = await files.backdrop();
  if (!splats) return null;
  const { name, bytes } = splats;
  const least = { value: 0 };
  const mesh = new SplatMesh({ fileBytes: bytes, fileName: name, objectModifier: thinner(least) });
  await mesh.initialized.catch(() => {
    throw new PageError(`${name} holds no splats that this page can read.`);
  });
  return new Backdrop(mesh, least);
}

/** Lets a splat vanish whose opacity times its two larger scales is under a limit. */
function thinner(least: { value: number }): NonNullable<SplatMesh['objectModifier']> {
  return dyno.dynoBlock({ gsplat: dyno.Gsplat }, { gsplat: dyno.Gsplat }, ({ gsplat }) => {
    const node = new dyno.Dyno({
      inTypes: { gsplat: dyno.Gsplat },
      outTypes: { gsplat: dyno.Gsplat },
      inputs: { gsplat },
      generate: ({ inputs, outputs }) => ({
        globals: [dyno.defineGsplat, 'uniform float backdropLeast;'],
        statements: dyno.unindentLines(`
          ${outputs.gsplat} = ${inputs.gsplat};
          vec3 scales = ${inputs.gsplat}.scales;
          float thinnest = max(min(scales.x, min(scales.y, scales.z)), 1e-9);
          float size = ${inputs.gsplat}.rgba.a * scales.x * scales.y * scales.z / thinnest;
          size *= 1.0 + ${APART} * float((uint(${inputs.gsplat}.index) * ${HASH}u) >> 8u) / 16777216.0;
          if (size < backdropLeast) ${outputs.gsplat}.flags = 0u;
        `),
        uniforms: { backdropLeast: least },
      }),
    });
    return { gsplat: node.outputs.gsplat };
  });
}
