import type { Conversation } from '../talk/conversation.ts';
import { byId } from './elements.ts';
import { icon } from './icons.ts';

/** Text box, microphone, send and stop: what the visitor does. */
export class Controls {
  private readonly form = byId<HTMLFormElement>('composer');
  private readonly input = byId<HTMLInputElement>('text');
  private readonly microphone = byId<HTMLButtonElement>('microphone');
  private readonly stop = byId<HTMLButtonElement>('stop');

  constructor() {
    this.microphone.append(icon('microphone'));
    this.stop.prepend(icon('stop'));
    byId('send').append(icon('send'));
    byId('panel-button').append(icon('chart'));
  }

  /** Shows itself and lets the visitor act on a conversation. */
  bind(conversation: Conversation): void {
    this.form.hidden = false;
    this.input.focus();
    this.form.onsubmit = (event) => {
      event.preventDefault();
      const text = this.input.value.trim();
      if (text && conversation.ask(text)) this.input.value = '';
    };
    this.microphone.onclick = () => void conversation.toggleMicrophone();
    this.stop.onclick = () => conversation.interrupt();
    document.addEventListener('keydown', (event) => {
      if (event.key === 'Escape') conversation.interrupt();
      if (event.key === '/' && document.activeElement !== this.input) {
        event.preventDefault();
        this.input.focus();
      }
    });
  }

  setMicrophone(open: boolean): void {
    this.microphone.setAttribute('aria-pressed', String(open));
    this.microphone.title = open ? 'Turn the microphone off' : 'Turn the microphone on';
  }

  setSpeaking(speaking: boolean): void {
    this.stop.classList.toggle('gone', !speaking);
    this.stop.inert = !speaking;
  }
}
