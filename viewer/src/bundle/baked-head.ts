import type { HeadInfo } from './manifest.ts';
import { MOVE_HIDDEN } from '../shared.ts';
import { takeTensor, type Tensor } from './safetensors.ts';

/** Gaussians of a head: N of them, with K basis vectors, and M displacements. */
export interface HeadRows {
  count: number; // N
  rank: number; // K
  moves: number; // M
  means: Float32Array; // (N,3) metres
  quats: Float32Array; // (N,4) wxyz
  scales: Float32Array; // (N,3) log of metres
  meanLogits: Float32Array; // (N,4) r, g, b, opacity
  basis: Int8Array; // (K,N,4)
  basisScale: Float32Array; // (N,)
  displacements: Int8Array; // (M,N,3)
}

/** A baked head (`docs/bundle.md`): its Gaussians, or the most important ones, and a small network from B values. */
export interface BakedHead extends HeadRows {
  network: Network;
  moving: Network; // from an expression to metres per unit of displacements, H = MOVE_HIDDEN
}

/** Of a head whose Gaussians stand still. */
export const STILL: Network = {
  inputs: 0,
  hidden: 0,
  outputs: 0,
  w1: new Float32Array(0),
  b1: new Float32Array(0),
  w2: new Float32Array(0),
  b2: new Float32Array(0),
};

/** c(e) = LeakyReLU(e·w1 + b1)·w2 + b2. */
export interface Network {
  inputs: number; // B
  hidden: number; // H
  outputs: number; // K
  w1: Float32Array; // (B,H)
  b1: Float32Array; // (H,)
  w2: Float32Array; // (H,K)
  b2: Float32Array; // (K,)
}

/** Takes a head's tensors out of its first file, checked against the manifest's counts. */
export function readBakedHead(tensors: Map<string, Tensor>, head: HeadInfo, file: string): BakedHead {
  const { num_gaussians: n, num_rest: rest, num_displacements: m, rank: k, hidden: h, expression_size: b } = head;
  const take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]): T =>
    takeTensor(tensors, name, dtype, shape, file).data as T;
  return {
    ...readHeadRows(tensors, n - rest, k, m, file),
    moving: m ? network(take, 'displacement_', b, MOVE_HIDDEN, m) : STILL,
    network: network(take, '', b, h, k),
  };
}

type Take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]) => T;

function network(take: Take, prefix: string, inputs: number, hidden: number, outputs: number): Network {
  return {
    inputs,
    hidden,
    outputs,
    w1: take(`${prefix}w1`, 'F32', [inputs, hidden]),
    b1: take(`${prefix}b1`, 'F32', [hidden]),
    w2: take(`${prefix}w2`, 'F32', [hidden, outputs]),
    b2: take(`${prefix}b2`, 'F32', [outputs]),
  };
}

/** Takes `n` Gaussians of a head with `k` basis vectors and `m` displacements out of a file. */
export function readHeadRows(tensors: Map<string, Tensor>, n: number, k: number, m: number, file: string): HeadRows {
  const take = <T>(name: string, dtype: Tensor['dtype'], shape: number[]): T =>
    takeTensor(tensors, name, dtype, shape, file).data as T;
  return {
    count: n,
    rank: k,
    moves: m,
    means: take('means', 'F32', [n, 3]),
    quats: take('quats', 'F16', [n, 4]),
    scales: take('scales', 'F16', [n, 3]),
    meanLogits: take('mean_logits', 'F16', [n, 4]),
    basis: take('basis', 'I8', [k, n, 4]),
    basisScale: take('basis_scale', 'F32', [n]),
    displacements: m ? take('displacement_basis', 'I8', [m, n, 3]) : new Int8Array(0),
  };
}
