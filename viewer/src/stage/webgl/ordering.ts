/** Numbers of Gaussians from `base` on. */
export interface Span {
  base: number;
  count: number;
}

/** Gaussians in the order in which they are drawn. */
export interface Ordering {
  order: Uint32Array;
  count: number; // of the numbers in `order` that hold
}

/** The same without those of some spans. */
export function without({ order, count }: Ordering, spans: readonly Span[]): Ordering {
  const left = new Uint32Array(order.length);
  let at = 0;
  for (let i = 0; i < count; i++) {
    const index = order[i]!;
    if (!spans.some(({ base, count: length }) => index >= base && index < base + length)) left[at++] = index;
  }
  return { order: left, count: at };
}
