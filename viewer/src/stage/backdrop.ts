import { SplatMesh } from '@sparkjsdev/spark';
import type { Actor } from '../actor.ts';
import type { BundleFiles } from '../bundle/load.ts';
import { PageError } from '../errors.ts';

/** Fetches the splats behind the person, if the bundle has some; they stand still. */
export async function makeBackdrop(files: BundleFiles): Promise<Actor | null> {
  const splats = await files.backdrop();
  if (!splats) return null;
  const { name, bytes } = splats;
  const mesh = new SplatMesh({ fileBytes: bytes, fileName: name });
  await mesh.initialized.catch(() => {
    throw new PageError(`${name} holds no splats that this page can read.`);
  });
  return { objects: [mesh], tick: () => false };
}
