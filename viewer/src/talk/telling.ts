import { codeOf, english } from '../words/text.ts';
import type { ConversationView } from './conversation.ts';
import type { Emit } from './events.ts';

/** A view of a conversation that also tells what it shows. */
export function telling(view: ConversationView, emit: Emit): ConversationView {
  const telling: Partial<ConversationView> = {
    state: (state) => {
      view.state(state);
      emit('state', { state });
    },
    question: (text, final) => {
      view.question(text, final);
      emit('user-transcript', { text, final });
    },
    answer: (text) => {
      view.answer(text);
      emit('avatar-transcript', { text });
    },
    connected: (resumed) => {
      view.connected(resumed);
      emit('connected', {});
    },
    ended: (ending) => {
      view.ended(ending);
      emit('error', { message: english(ending.sentence), code: codeOf(ending.sentence), fatal: true });
    },
  };
  return Object.assign(Object.create(view) as ConversationView, telling); // all else is the view's
}
