import type { Page } from 'playwright-core';

/** What came over the wire. */
export interface Wire {
  bytes: number; // of all answers, with their headers
  scripts: number; // bytes of JavaScript
  names: string[]; // of the files, in the order in which they were asked for
}

/** From now on the page's network is slow; gives what has come over it, counted by the browser. */
export async function slowNetwork(page: Page, bitsPerSecond: number, latency: number): Promise<Wire> {
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
  const throughput = bitsPerSecond / 8;
  await cdp.send('Network.emulateNetworkConditions', { offline: false, latency, downloadThroughput: throughput, uploadThroughput: throughput });
  return wire;
}
