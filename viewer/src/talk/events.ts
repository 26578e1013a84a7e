/** What is told of a conversation to the page around it: details by name of the event. */
export interface TalkEvents {
  /** A session has begun or goes on. */
  connected: Record<string, never>;
  state: { state: 'connecting' | 'queued' | 'idle' | 'listening' | 'thinking' | 'speaking' | 'ended' };
  /** What the visitor says or has typed; texts that are not final are replaced by the next one. */
  'user-transcript': { text: string; final: boolean };
  /** A sentence that the avatar is about to say. */
  'avatar-transcript': { text: string };
  /** The first sound of an utterance is on its way to the loudspeaker. */
  'speak-start': { utterance: number };
  'speak-end': { utterance: number; interrupted: boolean };
  /** A gesture of a body on a skeleton, told up to a second ahead; `begin` and `stroke` are seconds of the utterance. */
  gesture: { utterance: number; name: string; mirror: boolean; begin: number; stroke: number };
  /** The language model calls a function of the server. */
  'tool-call': { name: string; arguments: Record<string, unknown> };
  /** Something went wrong; after a fatal error the conversation is over. `code` names the English sentence, if it has a name. */
  error: { message: string; code: string; fatal: boolean };
}

/** Tells of an event. */
export type Emit = <K extends keyof TalkEvents>(name: K, detail: TalkEvents[K]) => void;

/** Tells when utterances begin and end, whatever ends them. */
export class Speaking {
  private readonly emit: Emit;
  private readonly heard = new Set<number>();

  constructor(emit: Emit) {
    this.emit = emit;
  }

  start(utterance: number): void {
    this.heard.add(utterance);
    this.emit('speak-start', { utterance });
  }

  finish(utterance: number): void {
    this.end(utterance, false);
  }

  /** All utterances up to one are interrupted. */
  stop(last = Infinity): void {
    for (const utterance of [...this.heard]) if (utterance <= last) this.end(utterance, true);
  }

  private end(utterance: number, interrupted: boolean): void {
    if (this.heard.delete(utterance)) this.emit('speak-end', { utterance, interrupted });
  }
}
