import type { MakePainter } from '../soft/contract.ts';

/** Fetches what draws without WebGL if an address asks for it (`?draw=soft`); undefined for Spark. */
export async function choosePainter(address: URL): Promise<MakePainter | undefined> {
  if (address.searchParams.get('draw') !== 'soft') return undefined;
  return (await import('../soft/painter.ts')).makeSoftPainter;
}
