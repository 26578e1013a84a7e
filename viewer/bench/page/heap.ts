import type { CDPSession } from 'playwright-core';

/** Bytes of a heap by whose they are. */
export interface Kinds {
  /** What V8 made of functions: machine code, and what it depends on. It grows until all that is called often was compiled. */
  code: number;
  /** Elements and other objects of the browser, among them the rows of the transcript. */
  browser: number;
  /** All that scripts made. */
  scripts: number;
}

interface Snapshot {
  snapshot: { meta: { node_fields: string[]; node_types: [string[], ...unknown[]] } };
  nodes: number[];
  strings: string[];
}

/** What a page's heap holds after collection, by kind. */
export async function heapByKind(cdp: CDPSession): Promise<Kinds> {
  const chunks: string[] = [];
  const take = ({ chunk }: { chunk: string }) => void chunks.push(chunk);
  cdp.on('HeapProfiler.addHeapSnapshotChunk', take);
  await cdp.send('HeapProfiler.collectGarbage');
  await cdp.send('HeapProfiler.takeHeapSnapshot', { reportProgress: false });
  cdp.off('HeapProfiler.addHeapSnapshotChunk', take);
  return sum(JSON.parse(chunks.join('')) as Snapshot);
}

function sum({ snapshot: { meta }, nodes, strings }: Snapshot): Kinds {
  const { node_fields: fields, node_types: [types] } = meta;
  const [type, name, size] = ['type', 'name', 'self_size'].map((field) => fields.indexOf(field)) as [number, number, number];
  const kinds: Kinds = { code: 0, browser: 0, scripts: 0 };
  for (let at = 0; at < nodes.length; at += fields.length) {
    kinds[kindOf(types[nodes[at + type]!]!, strings[nodes[at + name]!]!)] += nodes[at + size]!;
  }
  return kinds;
}

function kindOf(type: string, name: string): keyof Kinds {
  if (type === 'code' || type === 'object shape' || name.startsWith('system / ')) return name.startsWith('system / Context') ? 'scripts' : 'code';
  return type === 'native' ? 'browser' : 'scripts';
}
