import { describe, expect, test } from 'vitest';
import { isSoftware } from '../../src/soft/graphics.ts';
import { choosePath, wishOf } from '../../src/stage/choosing.ts';

const SOFTWARE = [
  'ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero) (0x0000C0DE)), SwiftShader driver)',
  'Google SwiftShader',
  'llvmpipe (LLVM 17.0.6, 256 bits)',
  'ANGLE (Mesa, llvmpipe (LLVM 15.0.7 256 bits), OpenGL 4.5)',
  'softpipe',
  'Mesa OffScreen',
  'Software Rasterizer',
  'ANGLE (Microsoft, Microsoft Basic Render Driver Direct3D11 vs_5_0 ps_5_0)',
  'Apple Software Renderer',
  'GDI Generic',
];
const CARDS = [
  'ANGLE (NVIDIA, NVIDIA GeForce RTX 3060 Direct3D11 vs_5_0 ps_5_0, D3D11)',
  'ANGLE (Intel, Mesa Intel(R) UHD Graphics 620 (KBL GT2), OpenGL 4.6)',
  'ANGLE (Apple, ANGLE Metal Renderer: Apple M1, Unspecified Version)',
  'Apple GPU',
  'Adreno (TM) 640',
  'Mali-G78',
  'AMD Radeon RX 6600 (radeonsi, navi23, LLVM 15.0.7, DRM 3.49)',
];

describe('what draws', () => {
  test.each(SOFTWARE)('%s is software', (name) => expect(isSoftware(name)).toBe(true));
  test.each(CARDS)('%s is a graphics card', (name) => expect(isSoftware(name)).toBe(false));

  test('is what suits the browser, unless something is wanted', () => {
    const card = () => ({ name: 'Mali-G78', software: false });
    const software = () => ({ name: '', software: true }); // whose name the browser hides
    expect(choosePath('auto', card)).toMatchObject({ path: 'webgl', why: { key: 'drawn.card', values: { name: 'Mali-G78' } } });
    expect(choosePath('auto', software)).toMatchObject({ path: 'soft', why: { key: 'drawn.software' } });
    expect(choosePath('webgl', software)).toMatchObject({ path: 'webgl', why: { key: 'drawn.chosen.webgl' } });
    expect(choosePath('soft', card)).toMatchObject({ path: 'soft', why: { key: 'drawn.chosen.soft' } });
  });

  test('is the processor where there is no WebGL 2, whatever is wanted', () => {
    for (const wish of ['auto', 'webgl'] as const) expect(choosePath(wish, () => null)).toMatchObject({ path: 'soft', why: { key: 'drawn.none' } });
  });

  test('is not looked for where the processor is wanted', () => {
    const look = () => expect.unreachable('a context is expensive');
    expect(choosePath('soft', look).path).toBe('soft');
  });

  test('may be wanted by an address; what it does not know is nothing', () => {
    expect(['webgl', 'soft', 'auto', 'webgpu', '', null].map((given) => wishOf(given))).toEqual(['webgl', 'soft', 'auto', 'auto', 'auto', 'auto']);
  });
});
