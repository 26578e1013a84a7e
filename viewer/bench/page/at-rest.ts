/** In the page: splats at rest, to compare those that move with. */
import { dyno, ExtSplats, SplatMesh } from '@sparkjsdev/spark';
import type { Generator } from '../../src/gaussians/generator.ts';
import { readTexels } from '../../src/stage/webgl/readback.ts';
import type { Stage } from '../../src/stage/stage.ts';

/** What generators made for the picture that was drawn last, as splats that go through an identity modifier; not yet visible. */
export async function putToRest(stage: Stage, generators: Generator[]): Promise<SplatMesh> {
  const mesh = new SplatMesh({
    constructSplats: (splats) => {
      for (const generator of generators) {
        const made = new ExtSplats({ extArrays: readTexels(stage, generator), numSplats: generator.numSplats });
        made.forEachSplat((_, centre, scales, quaternion, opacity, colour) => {
          if (opacity > 0) splats.pushSplat(centre, scales, quaternion, opacity, colour);
        });
      }
    },
    objectModifier: dyno.dynoBlock({ gsplat: dyno.Gsplat }, { gsplat: dyno.Gsplat }, ({ gsplat }) => ({ gsplat })),
  });
  await mesh.initialized;
  mesh.visible = false;
  stage.scene.add(mesh);
  return mesh;
}
