import { dyno, SplatMesh } from '@sparkjsdev/spark';
import type { Actor } from '../../actor.ts';
import type { SoftObject, Source } from '../../soft/source.ts';
import { checkSplats, isTurned, type SplatFile } from './file.ts';
import { APART, HASH, NUMBERS, sizeOf, sourceOf } from './rows.ts';
import type { StillGenerator } from './still.ts';
import { unreadable } from './unpacking.ts';

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
    this.sizes = new Float32Array(mesh.numSplats);
    mesh.forEachSplat((index, _, { x, y, z }, __, opacity) => (this.sizes[index] = sizeOf(index, opacity, x, y, z)));
    this.sizes.sort();
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
  const rows = new Float32Array(NUMBERS * mesh.numSplats);
  mesh.forEachSplat((index, centre, scales, turn, opacity, colour) => {
    const at = NUMBERS * index;
    centre.toArray(rows, at);
    [rows[at + 3], rows[at + 4], rows[at + 5], rows[at + 6]] = [turn.w, turn.x, turn.y, turn.z];
    scales.toArray(rows, at + 7);
    [rows[at + 10], rows[at + 11], rows[at + 12], rows[at + 13]] = [colour.r, colour.g, colour.b, opacity];
  });
  return sourceOf(rows);
}

/** Reads the splats behind the person. */
export async function makeBackdrop(file: SplatFile): Promise<Actor> {
  await checkSplats(file);
  const least = { value: 0 };
  const mesh = makeMesh(file, least);
  await mesh.initialized.catch(() => {
    throw unreadable(file.name);
  });
  return new Backdrop(mesh, least);
}

/** What Spark draws of splats that were read without it, as soon as it has read them, too. */
export function makeTwin(of: StillGenerator): SplatMesh {
  const least = { value: 0 };
  let backdrop: Backdrop | null = null;
  let shown = 0; // version
  const mesh = makeMesh(of.file, least, () => {
    if (!mesh.isInitialized || of.version === shown) return;
    shown = of.version;
    backdrop ??= new Backdrop(mesh, least);
    backdrop.thin(of.share);
  });
  return mesh;
}

/** @param onFrame called before each picture */
function makeMesh({ name, bytes }: SplatFile, least: { value: number }, onFrame?: () => void): SplatMesh {
  const mesh = new SplatMesh({ fileBytes: bytes.slice(0), fileName: name, objectModifier: thinner(least), ...(onFrame ? { onFrame } : {}) });
  if (isTurned({ name, bytes })) mesh.quaternion.set(1, 0, 0, 0);
  return mesh;
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
