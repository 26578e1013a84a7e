import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, test, vi } from 'vitest';
import { identityOf, loadManifest } from '../../src/bundle/load.ts';
import { blinkIndices, checkManifest } from '../../src/bundle/manifest.ts';
import { parseSafetensors } from '../../src/bundle/safetensors.ts';
import { readBakedHead } from '../../src/bundle/baked-head.ts';
import { coefficients } from '../../src/head/coefficients.ts';
import { arrayBuffer, makeReference } from '../../support/references/head.ts';

const reference = makeReference({ gaussians: 37 });
const read = (name: string) => readFileSync(join(reference.folder, name));
const manifest = checkManifest(JSON.parse(read('manifest.json').toString()));
const info = manifest.head!;
const headFile = arrayBuffer(read('head.safetensors'));
const parse = () => readBakedHead(parseSafetensors(headFile, 'head'), info, 'head');

describe('a bundle that Python wrote', () => {
  test('its coefficients are those of the Python evaluator', () => {
    const { network, rank } = parse();
    const out = new Float32Array(rank);
    reference.expressions.forEach((row, i) => {
      coefficients(network, Float32Array.from(row), out);
      reference.coefficients[i]!.forEach((value, k) => expect(out[k]).toBeCloseTo(value, 4));
    });
  });

  test('its attributes follow from means, basis and scale', () => {
    const head = parse();
    const c = reference.coefficients[2]!;
    for (let i = 0; i < 4 * head.count; i++) {
      const blend = c.reduce((sum, value, k) => sum + value * head.basis[k * 4 * head.count + i]!, 0);
      const logit = head.meanLogits[i]! + head.basisScale[Math.floor(i / 4)]! * blend;
      expect(1 / (1 + Math.exp(-logit))).toBeCloseTo(reference.attributes[2 * 4 * head.count + i]!, 4);
    }
  });

  test('its provenance is text, and what older bundles do not state may lack', () => {
    const written = JSON.parse(read('manifest.json').toString());
    expect(checkManifest(written).provenance).toMatchObject({ consent: 'none needed' });
    for (const wrong of [null, { ...written.provenance, likeness: 3 }, { ...written.provenance, sources: 'me.mp4' }, { ...written.provenance, voice: { recording: 'me.mp4' } }]) {
      expect(() => checkManifest({ ...written, provenance: wrong })).toThrow(/manifest\.json: provenance\.[\w.]+ is missing or not/);
    }
  });

  test('what it has to work through is bounded, as it is for a server', () => {
    const written = JSON.parse(read('manifest.json').toString());
    const head = { ...written.head, num_gaussians: 900_000, num_rest: 0, rank: 60 };
    expect(() => checkManifest({ ...written, head })).toThrow(/head\.rank/);
    const skinned = {
      ...{ fps: 25, low: [0, 0, 0], high: [1, 1, 1], names: ['hips'], parents: [-1], num_frames: 4000, num_gaussians: 1 },
      ...{ num_shapes: 1, num_moving: 1, num_known: 4000, num_rest: 0, num_casters: 0 },
    };
    const alone = { ...written, head: null, speech: null, body: null };
    expect(() => checkManifest({ ...alone, skinned })).toThrow(/skinned\.num_known/);
    expect(() => checkManifest({ ...alone, skinned: { ...skinned, num_known: 256 } })).not.toThrow(/num_known/);
  });

  test('is told from another person, and from itself in another part', () => {
    const { persona, files } = manifest;
    const others = [
      { ...manifest, name: 'another' },
      { ...manifest, persona: { ...persona, name: 'Ada' } },
      { ...manifest, persona: { ...persona, greeting: 'Welcome to the museum.' } },
      { ...manifest, files: { ...files, 'head.safetensors': { size: 1, sha256: '0' } } },
    ];
    const identities = [manifest, ...others].map(identityOf);
    expect(new Set(identities).size).toBe(identities.length);
    expect(identityOf(checkManifest(JSON.parse(read('manifest.json').toString())))).toBe(identities[0]);
  });

  test('eyelids lie behind the five brow values', () => {
    expect(blinkIndices(info)).toEqual([37, 38]);
    const named = { ...info, eye_offset: null, expression_names: ['jawOpen', 'eyeBlinkRight', 'eyeBlinkLeft'] };
    expect(blinkIndices(named)).toEqual([2, 1]);
  });
});

describe('a damaged bundle is refused in one sentence', () => {
  const cases: [string, () => unknown, RegExp][] = [
    ['cut short', () => parseSafetensors(headFile.slice(0, -1), 'head'), /does not fit its shape/],
    ['empty', () => parseSafetensors(new ArrayBuffer(3), 'head'), /too short/],
    ['header cut', () => parseSafetensors(headFile.slice(0, 40), 'head'), /ends before its header/],
    ['no header', () => parseSafetensors(withHeader('{'), 'head'), /not JSON/],
    ['unknown type', () => parseSafetensors(withHeader(entry('F64', [1], 8), 8), 'head'), /F64/],
    ['tensors in one place', () => parseSafetensors(withHeader(spans([0, 4], [0, 4]), 4), 'head'), /overlap or leave a gap/],
    ['tensors that overlap', () => parseSafetensors(withHeader(spans([2, 6], [0, 4]), 6), 'head'), /overlap or leave a gap/],
    ['a gap', () => parseSafetensors(withHeader(spans([0, 4], [5, 6]), 6), 'head'), /overlap or leave a gap/],
    ['bytes of no tensor', () => parseSafetensors(withHeader(spans([0, 4]), 6), 'head'), /bytes that belong to no tensor/],
    ['other counts', () => readBakedHead(parseSafetensors(headFile, 'head'), { ...info, rank: 3 }, 'head'), /basis/],
    ['not finite', () => readBakedHead(spoiled(), info, 'head'), /means holds numbers that are not finite/],
    ['other format', () => checkManifest({ format: 'zip' }), /not that of an avatar bundle/],
    ['other version', () => checkManifest({ ...manifest, version: 8 }), /format version 8/],
    ['not a manifest', () => checkManifest(null), /not that of an avatar bundle/],
    ['short idle face', () => checkManifest({ ...manifest, head: { ...manifest.head, idle_expression: [0] } }), /idle_expression/],
    ['more Gaussians than there is room for', () => checkManifest({ ...manifest, head: { ...manifest.head, num_gaussians: 1_000_001 } }), /head\.num_gaussians/],
    ['a rank without end', () => checkManifest({ ...manifest, head: { ...manifest.head, rank: 65 } }), /head\.rank/],
    ['displacements without end', () => checkManifest({ ...manifest, head: { ...manifest.head, num_displacements: 17 } }), /head\.num_displacements/],
    ['displacements beside ranks of many Gaussians', () => checkManifest({ ...manifest, head: { ...manifest.head, num_gaussians: 700_000, rank: 8, num_displacements: 4 } }), /head\.rank/],
    ['eyes that roll', () => checkManifest({ ...manifest, head: { ...manifest.head, gaze: { eyes: [0, 0, 0.06], most: [0.2, 0.6] } } }), /head\.gaze\.most/],
    ['eyes far from the head', () => checkManifest({ ...manifest, head: { ...manifest.head, gaze: { eyes: [0, 2, 0], most: [0.2, 0.1] } } }), /head\.gaze\.eyes/],
    ['eyes that turn by nothing', () => checkManifest({ ...manifest, head: { ...manifest.head, num_displacements: 0, gaze: { eyes: [0, 0, 0], most: [0.2, 0.1] } } }), /head\.num_displacements/],
    ['poses without end', () => checkManifest({ ...manifest, head: { ...manifest.head, num_poses: 100_001 } }), /head\.num_poses/],
    ['a window without end', () => checkManifest({ ...manifest, head: null, body: lasting(1001) }), /body\.windows\[0\] /],
    ['a step between windows', () => checkManifest({ ...manifest, head: null, body: { ...lasting(9), samples_per_frame: 9 } }), /body\.samples_per_frame/],
    ['more components than a body has', () => checkManifest({ ...manifest, head: null, body: windows([1, [17, 1, 1]]) }), /body\.windows\[0\]\.ranks/],
    ['windows that fill a place each in its own way', () => checkManifest({ ...manifest, head: null, body: windows([233_017, [1, 1, 1]], [9, [14, 1, 1]], [9, [1, 1, 2]]) }), /body\.windows /],
    ['curves without end', () => checkManifest({ ...manifest, head: null, body: { ...lasting(1000), samples_per_frame: 8, windows: [{ ...lasting(1000).windows[0]!, num_clusters: 175 }] } }), /body\.windows\[0\]\.num_clusters/],
    ['a file without end', () => checkManifest({ ...manifest, files: { x: { sha256: '', size: 2 ** 28 + 1 } } }), /files\.x/],
    ['gestures without end', () => checkManifest({ ...manifest, files: { 'body/gestures.safetensors': { sha256: '', size: 2 ** 22 + 1 } } }), /files\.body/],
    ['an animation without end', () => checkManifest({ ...manifest, files: { 'animation.json': { sha256: '', size: 2 ** 20 + 1 } } }), /files\.animation/],
    ['files without end', () => checkManifest({ ...manifest, files: manyFiles(3, 2 ** 28 - 1) }), /files /],
    ['files without number', () => checkManifest({ ...manifest, files: manyFiles(257, 1) }), /files /],
    ['no files', () => checkManifest({ ...manifest, files: undefined }), /files/],
    ['no camera', () => checkManifest({ ...manifest, camera: null }), /camera/],
  ];
  test.each(cases)('%s', (_, act, sentence) => expect(act).toThrow(sentence));
});

test('the numbers of a tensor are made once, when somebody asks for them', () => {
  const slice = vi.spyOn(ArrayBuffer.prototype, 'slice');
  const tensors = parseSafetensors(headFile, 'head');
  expect(slice).not.toHaveBeenCalled();
  const means = tensors.get('means')!;
  expect(means.data).toBe(means.data);
  expect(slice).toHaveBeenCalledOnce();
  slice.mockRestore();
});

/** So many files of so many bytes. */
function manyFiles(count: number, size: number) {
  return Object.fromEntries(Array.from({ length: count }, (_, i) => [`${i}`, { sha256: '', size }]));
}

test('windows may fill what a place holds', () => {
  const body = windows([233_016, [1, 1, 1]], [9, [14, 1, 1]], [9, [1, 1, 2]]);
  expect(checkManifest({ ...manifest, head: null, body }).body).toEqual(body);
});

test('a manifest is read no further than it may be long', async () => {
  const located = (text: string) => () => `data:application/json,${encodeURIComponent(text)}`;
  const spaced = JSON.stringify(manifest) + ' '.repeat(2 ** 20 - JSON.stringify(manifest).length);
  await expect(loadManifest(located(spaced))).resolves.toMatchObject({ name: manifest.name });
  await expect(loadManifest(located(`${spaced} `))).rejects.toThrow(/larger than 1048576 bytes/);
  await expect(loadManifest(located('{'))).rejects.toThrow(/not that of an avatar bundle/);
});

/** A body with one window. */
function lasting(frames: number) {
  const window = { first: 0, last: frames, num_gaussians: 1, num_clusters: 1, ranks: [1, 1, 1], file: 'body/0000.safetensors' };
  return { fps: 25, samples_per_frame: 1, low: [0, 0, 0], high: [1, 1, 1], windows: [window] };
}

/** A body with a window of ten frames for each number of Gaussians and their components. */
function windows(...kinds: [number, [number, number, number]][]) {
  const listed = kinds.map(([num_gaussians, ranks], i) => ({ first: 9 * i, last: 9 * i + 9, num_gaussians, num_clusters: 1, ranks, file: `body/000${i}.safetensors` }));
  return { ...lasting(9), windows: listed };
}

function entry(dtype: string, shape: number[], size: number): string {
  return JSON.stringify({ x: { dtype, shape, data_offsets: [0, size] } });
}

/** Tensors of bytes. */
function spans(...offsets: [number, number][]): string {
  return JSON.stringify(Object.fromEntries(offsets.map(([begin, end], i) => [i, { dtype: 'U8', shape: [end - begin], data_offsets: [begin, end] }])));
}

function withHeader(header: string, dataSize = 0): ArrayBuffer {
  const bytes = new Uint8Array(8 + header.length + dataSize);
  new DataView(bytes.buffer).setBigUint64(0, BigInt(header.length), true);
  bytes.set(new TextEncoder().encode(header), 8);
  return bytes.buffer;
}

function spoiled() {
  const tensors = parseSafetensors(headFile, 'head');
  tensors.get('means')!.data[4] = Infinity;
  return tensors;
}
