import { dyno, type SplatGenerator, type SplatTransformer } from '@sparkjsdev/spark';

/** What makes the Gaussians of a Spark object on the GPU. */
export type Generator = NonNullable<SplatGenerator['generator']>;

/** A shader that writes one Gaussian. */
export interface SplatShader {
  declarations: string; // GLSL of its uniforms
  uniforms: Record<string, { value: unknown }>;
  /** GLSL that fills `gsplat`, a variable's name, for the Gaussian of number `index`, another one's. */
  statements(index: string, gsplat: string): string[];
}

/** A generator that runs a shader for each Gaussian and then places it with its object. */
export function splatGenerator(shader: SplatShader, transformer: SplatTransformer): Generator {
  return dyno.dynoBlock({ index: 'int' }, { gsplat: dyno.Gsplat }, ({ index }) => {
    const node = new dyno.Dyno({
      inTypes: { index: 'int' },
      outTypes: { gsplat: dyno.Gsplat },
      inputs: { index },
      generate: ({ inputs, outputs }) => ({
        globals: [dyno.defineGsplat, shader.declarations],
        statements: shader.statements(inputs.index!, outputs.gsplat!),
        uniforms: shader.uniforms,
      }),
    });
    return { gsplat: transformer.applyGsplat(node.outputs.gsplat) };
  });
}
