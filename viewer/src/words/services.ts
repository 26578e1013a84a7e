import { english, say, type Key, type Sentence } from './text.ts';

/** Services that have no name of their own; `ico3d/chat/services` tells them by these words in English. */
const DESCRIBED: readonly Key[] = [
  'service.browser',
  'service.local',
  'service.process',
  'service.notes',
  'service.smollm',
  'service.openai',
];

/**
 * A service's name in the page's language, where it is one that describes; proper names stay.
 *
 * @param name as the server tells it, perhaps with a detail in brackets
 */
export function serviceName(name: string): Sentence {
  for (const key of DESCRIBED) {
    const title = english(say(key));
    if (name === title) return say(key);
    const detail = name.startsWith(`${title} (`) && name.slice(title.length + 2, -1);
    if (detail) return say('service.detailed', { name: say(key), detail });
  }
  return name;
}
