import type { Wish } from '../../stage/choosing.ts';
import { byId } from '../elements.ts';

/** Lets the visitor choose what draws, from what is wanted at first. */
export function offerDrawing(root: ParentNode, wish: Wish, changed: (wish: Wish) => void): void {
  const select = byId<HTMLSelectElement>(root, 'draw');
  select.value = wish;
  select.onchange = () => changed(select.value as Wish);
}
