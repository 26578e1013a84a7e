import type { Easel, MakePainter, Painter, PainterPorts } from '../soft/contract.ts';
import type { Message } from '../words/text.ts';

/** What draws, and why it does. */
export interface Drawing {
  make: MakePainter;
  why: Message;
}

/** Who draws on stage, and on which canvas: another painter may take over. */
export class Painting {
  painter: Painter;
  why: Message;
  private picture: HTMLCanvasElement; // that the painter paints on
  private readonly easel: Easel;
  private readonly ports: PainterPorts;

  /** @param easel its canvas takes the first painter's pictures, and stays the place of all others */
  constructor(easel: Easel, ports: PainterPorts, { make, why }: Drawing) {
    this.easel = easel;
    this.ports = ports;
    this.picture = easel.canvas;
    this.painter = make(easel, ports);
    this.why = why;
  }

  /**
   * Another painter takes over. It gets a canvas of its own over the first one, as a canvas keeps the
   * kind of its context for ever; the picture of before is seen until the new one has drawn.
   *
   * @param prepare makes the new painter ready for its first picture, while the old one goes on
   * @param begin draws that picture
   */
  async change({ make, why }: Drawing, prepare: (painter: Painter) => Promise<void>, begin: () => void): Promise<void> {
    const { painter: before, picture: old, easel } = this;
    const picture = makeCanvas(easel.canvas);
    const painter = make({ ...easel, canvas: picture }, this.ports);
    await prepare(painter);
    before.loop(null);
    [this.painter, this.why, this.picture] = [painter, why, picture];
    begin();
    await painter.shown();
    picture.style.visibility = '';
    before.dispose();
    if (old === easel.canvas) old.width = old.height = 1; // its pixels; it still takes what the visitor does
    else old.remove();
  }

  dispose(): void {
    this.painter.dispose();
  }
}

/** A canvas over another one, not seen yet, that lets the visitor through. */
function makeCanvas(under: HTMLCanvasElement): HTMLCanvasElement {
  const picture = under.ownerDocument.createElement('canvas');
  picture.className = 'picture';
  picture.style.visibility = 'hidden';
  picture.setAttribute('aria-hidden', 'true');
  under.after(picture);
  return picture;
}
