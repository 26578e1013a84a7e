/** What the server gives out as `/embed.js`: elements without `server` belong to it. */
import { setServer } from './api.ts';
import { defineAvatar } from './element.ts';

export * from './api.ts';

const { url } = import.meta; // on its own: bundlers take `new URL` with it for a file of theirs
setServer(new URL('.', url));
defineAvatar();
