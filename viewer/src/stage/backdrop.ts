import { dyno, SplatMesh } from '@sparkjsdev/spark';
import type { Actor } from '../actor.ts';
import type { BundleFiles } from '../bundle/load.ts';
import { PageError } from '../errors.ts';

const LEAST = 1e-9; // m, of a scale
const HASH = 2654435769;
const APART = 1e-3; // by which splats of one size differ, each by a share of its own: else all of them would go at once

/** The splats behind the person, which stand still. */
class Backdrop implements Actor {
  readonly objects: SplatMesh[];
  private readonly mesh: SplatMesh;
  private readonly sizes: Float32Array; // m², in rising order
  private readonly least: { value: number }; // m², of those that are drawn

  /** @param least as the mesh's modifier reads it */
  constructor(mesh: SplatMesh, least: { value: number }) {
    this.mesh = mesh;
    this.objects = [mesh];
    this.least = least;
    const sizes: number[] = [];
    mesh.forEachSplat((index, _, { x, y, z }, __, opacity) => {
      sizes.push(((opacity * x * y * z) / Math.max(LEAST, Math.min(x, y, z))) * (1 + (APART * (Math.imul(index, HASH) >>> 8)) / 2 ** 24));
    });
    this.sizes = Float32Array.from(sizes).sort();
  }

  tick(): boolean {
    return false;
  }

  thin(share: number): void {
    const index = Math.floor((1 - share) * this.sizes.length);
    this.least.value = index > 0 ? this.sizes[index]! : 0;
    this.mesh.updateVersion();
  }
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
