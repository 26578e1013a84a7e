/**
 * Tells whether the microphone is blocked for this page, now and whenever that changes; nothing where the browser does
 * not say.
 */
export async function watchBlocked(changed: (blocked: boolean) => void, signal: AbortSignal): Promise<void> {
  try {
    const status = await navigator.permissions.query({ name: 'microphone' as PermissionName });
    const tell = () => signal.aborted || changed(status.state === 'denied');
    status.addEventListener('change', tell, { signal });
    tell();
  } catch {} // the browser does not know of such a permission
}
