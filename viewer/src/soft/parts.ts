import type { Late, Source } from './source.ts';

/** Gaussians that come in several parts, the most important ones first, as one source. */
export class PackedParts<Part extends { count: number }> {
  private readonly parts: readonly Part[];
  private readonly pack: (part: Part) => Source;
  private packed: Source | null = null;

  /** @param parts more may come later */
  constructor(parts: readonly Part[], pack: (part: Part) => Source) {
    this.parts = parts;
    this.pack = pack;
  }

  /** All that have come. */
  get source(): Source {
    if (this.packed?.count !== this.count) this.packed = joined(this.parts.map(this.pack));
    return this.packed!;
  }

  /** Number of Gaussians that are drawn while what came after the first part is seen by a share. */
  drawn(share: number): number {
    return share > 0 ? this.count : this.parts[0]!.count;
  }

  /** What came after the first part, seen by a share, while sizes of the first are multiplied. */
  late(share: number, wide: number): Late {
    return { first: this.parts[0]!.count, share, wide };
  }

  private get count(): number {
    return this.parts.reduce((sum, { count }) => sum + count, 0);
  }
}

/** One source of several, whose Gaussians follow each other. */
function joined(sources: readonly Source[]): Source {
  const bytes = new Uint8Array(sources.reduce((sum, { rows }) => sum + rows.byteLength, 0));
  let at = 0;
  for (const { rows } of sources) {
    bytes.set(new Uint8Array(rows), at);
    at += rows.byteLength;
  }
  return { ...sources[0]!, count: sources.reduce((sum, { count }) => sum + count, 0), rows: bytes.buffer };
}
