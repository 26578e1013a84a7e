import { SplatMesh } from '@sparkjsdev/spark';
import type { Actor } from '../actor.ts';
import { BACKGROUNDS, loadFile } from '../bundle/load.ts';
import type { Manifest } from '../bundle/manifest.ts';
import { PageError } from '../errors.ts';

/** Fetches the splats behind the person, if the bundle has some; they stand still. */
export async function makeBackdrop(manifest: Manifest, loaded: (bytes: number) => void): Promise<Actor | null> {
  const name = BACKGROUNDS.find((file) => file in manifest.files);
  if (name === undefined) return null;
  const mesh = new SplatMesh({ fileBytes: await loadFile(manifest, name, loaded), fileName: name });
  await mesh.initialized.catch(() => {
    throw new PageError(`${name} holds no splats that this page can read.`);
  });
  return { objects: [mesh], tick: () => false };
}
