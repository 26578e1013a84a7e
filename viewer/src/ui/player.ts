import { every } from '../lifetime.ts';
import type { Seen } from '../motion/motion.ts';
import type { Playback } from '../motion/playback.ts';
import type { PageWords } from '../words/page-words.ts';
import { say } from '../words/text.ts';
import { byId } from './elements.ts';
import { icon } from './icons.ts';
import { isFor } from './keyboard/keys.ts';

const REFRESH = 100; // ms

/** Play, pause and scrub: where a body is in its time. */
export class PlayerBar {
  private readonly body: { readonly shown: Seen | null };
  private readonly playback: Playback;
  private readonly words: PageWords;
  private readonly root: HTMLElement;
  private readonly button: HTMLButtonElement;
  private readonly scrub: HTMLInputElement;
  private readonly clock: HTMLOutputElement;
  private plays: boolean | null = null; // as the button shows it
  private resumes = false; // once the slider is let go

  /** @param frame s between two frames of the recording: a step of the arrow keys */
  constructor(page: ParentNode, words: PageWords, body: PlayerBar['body'], playback: Playback, frame: number, signal: AbortSignal) {
    this.words = words;
    this.root = byId(page, 'player');
    this.button = byId(page, 'play');
    this.scrub = byId(page, 'scrub');
    this.clock = byId(page, 'clock');
    this.body = body;
    this.playback = playback;
    this.scrub.max = String(playback.duration);
    this.scrub.step = String(frame / 10);
    this.button.onclick = () => this.toggle();
    this.scrub.oninput = () => playback.seek(this.scrub.valueAsNumber);
    this.scrub.onkeydown = (event) => this.key(event, frame);
    this.scrub.onpointerdown = () => this.hold();
    this.scrub.onpointerup = this.scrub.onpointercancel = () => this.release();
    byId(page, 'stage').addEventListener('keydown', (event) => this.space(event), { signal });
    this.root.hidden = false;
    every(REFRESH, signal, () => this.refresh());
    this.refresh();
  }

  private toggle(): void {
    this.playback.playing = !this.playback.playing;
    this.refresh();
  }

  private space(event: KeyboardEvent): void {
    if (!isFor('play', event)) return;
    event.preventDefault();
    this.toggle();
  }

  /** Arrow keys go from frame to frame. */
  private key(event: KeyboardEvent, frame: number): void {
    const step = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    const { playback } = this;
    playback.seek((Math.round(playback.time / frame) + step) * frame);
    this.refresh();
  }

  private hold(): void {
    const { playback } = this;
    this.resumes = playback.playing;
    playback.playing = false;
  }

  private release(): void {
    this.playback.playing ||= this.resumes;
    this.resumes = false;
    this.refresh();
  }

  private refresh(): void {
    const { playback } = this;
    this.scrub.value = String(playback.time);
    this.words.write(this.scrub, say('playback.seconds', { n: Math.round(10 * playback.time) / 10 }), 'valuetext');
    this.clock.textContent = `${label(playback.time)} / ${label(playback.duration)}`;
    this.root.setAttribute('aria-busy', String(this.body.shown?.waiting ?? true));
    const plays = playback.playing || this.resumes;
    if (plays === this.plays) return;
    this.plays = plays;
    this.words.name(this.button, say(plays ? 'playback.pause' : 'playback.play'));
    this.button.replaceChildren(icon(plays ? 'pause' : 'play'));
  }
}

/** Minutes and seconds: 1:05.3. */
export function label(seconds: number): string {
  const tenths = Math.round(seconds * 10);
  const minutes = Math.floor(tenths / 600);
  return `${minutes}:${((tenths % 600) / 10).toFixed(1).padStart(4, '0')}`;
}
