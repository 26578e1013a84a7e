import { BandPainter, type Order } from './band.ts';

/** Draws one band of each picture, in a thread of its own. */
const painter = BandPainter.make();

onmessage = async ({ data }: MessageEvent<Order>) => {
  const band = await painter;
  if ('put' in data) {
    band.put(data.put, data.source);
    return;
  }
  const drawn = band.draw(data.frame, data.cloth, data.sharpness);
  postMessage(drawn, { transfer: [drawn.pixels] });
};
