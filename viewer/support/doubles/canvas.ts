/** An element that hears events and has a size: enough of a canvas for controls, without a browser. */
export class FakeCanvas extends EventTarget {
  readonly style: Record<string, string> = {};
  readonly ownerDocument = new EventTarget();
  readonly clientWidth: number;
  readonly clientHeight: number;

  constructor(width: number, height: number) {
    super();
    this.clientWidth = width;
    this.clientHeight = height;
    globalThis.matchMedia ??= () => ({ matches: false }) as MediaQueryList;
  }

  get element(): HTMLCanvasElement {
    return this as unknown as HTMLCanvasElement;
  }

  getRootNode(): EventTarget {
    return this.ownerDocument;
  }

  getBoundingClientRect(): Pick<DOMRect, 'left' | 'top' | 'width' | 'height'> {
    return { left: 0, top: 0, width: this.clientWidth, height: this.clientHeight };
  }

  setPointerCapture(): void {}
  releasePointerCapture(): void {}

  /** One notch of the wheel: −1 towards what is under the pointer. */
  wheel(x: number, y: number, notches: number): void {
    this.send(this, 'wheel', { clientX: x, clientY: y, deltaX: 0, deltaY: 100 * notches, deltaMode: 0 });
  }

  /** A key pressed while the canvas has the focus. */
  press(key: string): void {
    this.send(this, 'keydown', { key });
  }

  /** A double click with the mouse. */
  doubleClick(x: number, y: number): void {
    this.send(this, 'dblclick', { clientX: x, clientY: y });
  }

  /** Two fingers from one pair of places to another. */
  pinch(from: [number, number][], to: [number, number][], steps = 20): void {
    const finger = (id: number, [x, y]: [number, number]) => ({
      pointerId: id,
      pointerType: 'touch',
      clientX: x,
      clientY: y,
      pageX: x,
      pageY: y,
      button: 0,
    });
    from.forEach((place, id) => this.send(this, 'pointerdown', finger(id, place)));
    for (let step = 1; step <= steps; step++) {
      from.forEach(([x, y], id) => {
        const [toX, toY] = to[id]!;
        const at: [number, number] = [x + ((toX - x) * step) / steps, y + ((toY - y) * step) / steps];
        this.send(this.ownerDocument, 'pointermove', finger(id, at));
      });
    }
    to.forEach((place, id) => this.send(this.ownerDocument, 'pointerup', finger(id, place)));
  }

  /** The mouse drags by some pixels. */
  drag(x: number, y: number): void {
    const mouse = (clientX: number, clientY: number) => ({ pointerId: 9, pointerType: 'mouse', button: 0, clientX, clientY });
    this.send(this, 'pointerdown', mouse(0, 0));
    this.send(this.ownerDocument, 'pointermove', mouse(x, y));
    this.send(this.ownerDocument, 'pointerup', mouse(x, y));
  }

  private send(to: EventTarget, type: string, fields: object): void {
    to.dispatchEvent(Object.assign(new Event(type, { cancelable: true }), fields));
  }
}
