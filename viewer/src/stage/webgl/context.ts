import { atEnd } from '../../lifetime.ts';

const PATIENCE = 10_000; // ms until a context that was lost counts as gone

/** What happens to a canvas's WebGL context. */
export interface ContextPorts {
  /** The browser took it away: the GPU was reset, or too many pages want one. */
  lost(): void;
  /** A new one is there, with nothing in it. */
  restored(): void;
  /** It does not come back. */
  gone(): void;
}

/**
 * Watches a canvas's context, until the signal. The renderer must have begun to watch it before: it
 * asks the browser for a new one, and prepares that.
 */
export function watchContext(canvas: EventTarget, ports: ContextPorts, signal: AbortSignal): void {
  let waiting: ReturnType<typeof setTimeout> | undefined;
  const lost = () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => ports.gone(), PATIENCE);
    ports.lost();
  };
  const restored = () => {
    clearTimeout(waiting);
    ports.restored();
  };
  canvas.addEventListener('webglcontextlost', lost, { signal });
  canvas.addEventListener('webglcontextrestored', restored, { signal });
  atEnd(signal, () => clearTimeout(waiting));
}
