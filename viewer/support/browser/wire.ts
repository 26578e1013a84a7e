import type { Page } from 'playwright-core';

/** What came over the wire. */
export interface Wire {
  bytes: number; // of all answers, with their headers
  scripts: number; // bytes of JavaScript
  names: string[]; // of the files, in the order in which they were asked for
}

/** Gives what comes over a page's network from now on, counted by the browser. */
export async function watchWire(page: Page): Promise<Wire> {
  const cdp = await page.context().newCDPSession(page);
  const wire: Wire = { bytes: 0, scripts: 0, names: [] };
  const scripts = new Set<string>();
  cdp.on('Network.requestWillBeSent', ({ requestId, request, type }) => {
    if (request.url.startsWith('http')) wire.names.push(new URL(request.url).pathname.slice(1));
    if (type === 'Script' || request.url.endsWith('.js')) scripts.add(requestId);
  });
  cdp.on('Network.loadingFinished', ({ requestId, encodedDataLength }) => {
    wire.bytes += encodedDataLength;
    if (scripts.has(requestId)) wire.scripts += encodedDataLength;
  });
  await cdp.send('Network.enable');
  return wire;
}
