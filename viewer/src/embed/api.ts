import { AvatarElement } from './element.ts';
import type { AvatarHandle, MountOptions } from './mount.ts';

export type { AvatarElement, AvatarEvents } from './element.ts';
export type { AvatarHandle, MountOptions, Piece, Pose } from './mount.ts';

/**
 * Shows an avatar alone, for those who have sound and face of their own.
 *
 * @param element takes the picture; it needs a size
 * @throws Error with one sentence if the avatar cannot be shown
 */
export async function mountAvatar(element: HTMLElement, options: MountOptions): Promise<AvatarHandle> {
  const { mount } = await import('./mount.ts');
  return mount(element, options);
}

/** Sets the server of elements that have no attribute `server`; elements that are there ask at once. */
export function setServer(address: string | URL): void {
  AvatarElement.server = String(address);
}
