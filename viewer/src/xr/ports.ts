import type { Head } from '../head/head.ts';
import type { Stage } from '../stage/stage.ts';
import type { Conversation } from '../talk/conversation.ts';
import type { PageWords } from '../words/page-words.ts';
import type { XrSettings } from './settings.ts';

export const XR_MODES = ['immersive-vr', 'immersive-ar'] as const;
export type XrMode = (typeof XR_MODES)[number];

/** What a headset shows, and how one talks there. */
export interface XrPorts {
  stage: Stage;
  conversation?: Pick<Conversation, 'player' | 'press' | 'release' | 'hearsButton' | 'isQuiet'>; // none of a body alone
  head?: Head;
  root: ParentNode; // of the page, whose captions and notices are shown in space, too
  words: PageWords;
  settings: XrSettings;
  /** Begins the talk where none has begun: who enters has clicked, and reaches no other button then. */
  begin(): void;
  /** Ends the visit. */
  signal: AbortSignal;
}
