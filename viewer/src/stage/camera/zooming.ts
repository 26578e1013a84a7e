/** A place on the canvas: −1 to 1, to the right and up. */
export type Place = [x: number, y: number];

/** What wheel and fingers ask for. */
export interface Zooming {
  /** Comes nearer to what is at a place, by a factor under 1. */
  zoom(at: Place, factor: number): void;
  /** What was at one place goes to another. */
  pull(from: Place, to: Place): void;
}

const WHEEL = 0.001; // of the distance, per pixel
const PADS = 0.01; // two fingers on a touch pad, which send far smaller steps
const LINE = 16; // pixels
const LONGEST = 300; // pixels of one step: free-running wheels

/** Where on a canvas a pointer is. */
export function placeOn(canvas: HTMLCanvasElement, { clientX, clientY }: MouseEvent): Place {
  const { left, top, width, height } = canvas.getBoundingClientRect();
  return [(2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height];
}

/** Hears wheel and two-finger gestures on a canvas, until the signal. */
export function listenToZooming(canvas: HTMLCanvasElement, signal: AbortSignal, { zoom, pull }: Zooming): void {
  const placeOf = (event: MouseEvent) => placeOn(canvas, event);
  const wheel = (event: WheelEvent) => {
    event.preventDefault();
    const pixels = event.deltaY * [1, LINE, LONGEST][event.deltaMode]!;
    const bounded = Math.max(-LONGEST, Math.min(LONGEST, pixels));
    zoom(placeOf(event), Math.exp(bounded * (event.ctrlKey ? PADS : WHEEL)));
  };
  canvas.addEventListener('wheel', wheel, { passive: false, signal });

  const fingers = new Map<number, PointerEvent>();
  const move = (event: PointerEvent) => {
    if (!fingers.has(event.pointerId)) return;
    const before = [...fingers.values()];
    fingers.set(event.pointerId, event);
    if (fingers.size !== 2) return;
    const after = [...fingers.values()];
    const [from, to] = [before, after].map((pair) => middle(pair.map(placeOf)));
    pull(from!, to!);
    zoom(to!, apart(before) / Math.max(1, apart(after)));
  };
  const lift = ({ pointerId }: PointerEvent) => fingers.delete(pointerId);
  const touch = (event: PointerEvent) => {
    if (event.pointerType === 'touch') fingers.set(event.pointerId, event);
  };
  canvas.addEventListener('pointerdown', touch, { signal });
  // Touches belong to the canvas until they end; a mouse does not matter here.
  canvas.ownerDocument.addEventListener('pointermove', move, { signal });
  for (const end of ['pointerup', 'pointercancel'] as const) canvas.ownerDocument.addEventListener(end, lift, { signal });
}

function middle(places: Place[]): Place {
  const [a, b] = places as [Place, Place];
  return [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
}

function apart(fingers: PointerEvent[]): number {
  const [a, b] = fingers as [PointerEvent, PointerEvent];
  return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
}
