/**
 * Tells a picture that took the focus from a pointer (class `pressed`) from one that a keyboard has reached:
 * browsers would frame both with the next key.
 */
export function markPressed(picture: HTMLElement, signal: AbortSignal): void {
  const tree = picture.getRootNode() as Document | ShadowRoot;
  const leave = () => tree.activeElement !== picture && picture.classList.remove('pressed'); // it stays so in a window that is left
  picture.addEventListener('pointerdown', () => picture.classList.add('pressed'), { signal });
  picture.addEventListener('blur', leave, { signal });
}
