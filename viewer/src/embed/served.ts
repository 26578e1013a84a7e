/** What the server gives out as `/embed.js`: elements without `server` belong to it. */
import { setServer } from './index.ts';

export * from './index.ts';

setServer(new URL('.', import.meta.url));
