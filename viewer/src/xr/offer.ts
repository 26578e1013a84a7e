import { PageError, sentenceOf } from '../errors.ts';
import { icon } from '../ui/icons.ts';
import { say, type Sentence } from '../words/text.ts';
import { XR_MODES, type XrMode, type XrPorts } from './ports.ts';

const REASON = 'xr-reason';
const ICONS = { 'immersive-vr': 'headset', 'immersive-ar': 'room' } as const;

/**
 * Offers VR and AR where the device has them, also when a headset is plugged in later. What draws for
 * headsets is fetched only then. Where the processor draws, the buttons are dim and say that it cannot be.
 *
 * @param bar takes the buttons
 * @param notice shows why it does not work
 * @returns offers them anew: something else draws now
 */
export function offerXr(bar: HTMLElement, ports: XrPorts, notice: (sentence: Sentence) => void): () => void {
  const { xr } = navigator;
  if (!xr) return () => {};
  const group = document.createElement('div');
  group.className = 'xr';
  bar.append(group);
  const show = async () => {
    const modes = await offered(xr);
    group.replaceChildren(...modes.map((mode) => makeButton(mode, ports, notice)));
    if (!isPossible(ports)) group.append(...modes.slice(0, 1).map(() => makeReason(ports)));
    const [best] = modes;
    ports.stage.enterXr = best ? () => enter(best, ports) : null;
    if (best && isPossible(ports)) await import('./immersion.ts'); // a session must begin right after the click
  };
  xr.addEventListener('devicechange', () => void show(), { signal: ports.signal });
  void show();
  return () => void show();
}

/** Whether what draws can draw for headsets. */
function isPossible({ stage }: XrPorts): boolean {
  return stage.painter.path === 'webgl';
}

async function offered(xr: XRSystem): Promise<XrMode[]> {
  const answers = await Promise.all(XR_MODES.map((mode) => xr.isSessionSupported(mode).catch(() => false)));
  return XR_MODES.filter((_, i) => answers[i]);
}

function makeButton(mode: XrMode, ports: XrPorts, notice: (sentence: Sentence) => void): HTMLButtonElement {
  const button = document.createElement('button');
  button.type = 'button';
  button.className = 'pill';
  const name = document.createElement('span'); // phones have no room for it
  ports.words.write(name, say(`xr.${mode}`));
  ports.words.name(button, say(`xr.${mode}`));
  button.append(icon(ICONS[mode]), name);
  if (!isPossible(ports)) {
    button.setAttribute('aria-disabled', 'true');
    button.setAttribute('aria-describedby', REASON);
    button.onclick = () => button.focus(); // as after a click in every browser; the reason stands there until the focus goes
    return button;
  }
  button.onclick = () => enter(mode, ports).catch((error: unknown) => notice(sentenceOf(error)));
  return button;
}

/** Why the buttons do nothing; it is seen as long as one of them has the focus or the pointer. */
function makeReason({ words }: XrPorts): HTMLElement {
  const reason = document.createElement('p');
  reason.id = REASON;
  words.write(reason, say('xr.soft'));
  return reason;
}

async function enter(mode: XrMode, ports: XrPorts): Promise<void> {
  if (!isPossible(ports)) throw new PageError(say('xr.soft'));
  ports.begin();
  const { Immersion } = await import('./immersion.ts');
  await Immersion.begin(mode, ports);
}
