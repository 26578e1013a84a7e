/**
 * Marks what holds a text box (`data-typing`) from when a pointer goes into the box until the box is left. The
 * focus alone does not tell that somebody types: the box has it from the beginning.
 */
export function markTyping(holder: HTMLElement, box: HTMLElement, signal: AbortSignal): void {
  box.addEventListener('pointerdown', () => holder.toggleAttribute('data-typing', true), { signal });
  box.addEventListener('blur', () => holder.removeAttribute('data-typing'), { signal });
}
