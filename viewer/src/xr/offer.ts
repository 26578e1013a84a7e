import { sentenceOf } from '../errors.ts';
import { icon } from '../ui/icons.ts';
import { say, type Sentence } from '../words/text.ts';
import { XR_MODES, type XrMode, type XrPorts } from './ports.ts';

const ICONS = { 'immersive-vr': 'headset', 'immersive-ar': 'room' } as const;

/**
 * Offers VR and AR where the device has them, also when a headset is plugged in later. What draws for
 * headsets is fetched only then.
 *
 * @param bar takes the buttons
 * @param notice shows why it does not work
 */
export async function offerXr(bar: HTMLElement, ports: XrPorts, notice: (sentence: Sentence) => void): Promise<void> {
  const { xr } = navigator;
  if (!xr) return;
  const group = document.createElement('div');
  group.className = 'xr';
  bar.append(group);
  const show = async () => {
    const modes = await offered(xr);
    group.replaceChildren(...modes.map((mode) => makeButton(mode, ports, notice)));
    const [best] = modes;
    ports.stage.enterXr = best ? () => enter(best, ports) : null;
    if (best) await import('./immersion.ts'); // a session must begin right after the click
  };
  xr.addEventListener('devicechange', () => void show(), { signal: ports.signal });
  await show();
}

async function offered(xr: XRSystem): Promise<XrMode[]> {
  const answers = await Promise.all(XR_MODES.map((mode) => xr.isSessionSupported(mode).catch(() => false)));
  return XR_MODES.filter((_, i) => answers[i]);
}

function makeButton(mode: XrMode, ports: XrPorts, notice: (sentence: Sentence) => void): HTMLButtonElement {
  const button = document.createElement('button');
  button.type = 'button';
  button.className = 'pill';
  const name = document.createElement('span');
  ports.words.write(name, say(`xr.${mode}`));
  button.append(icon(ICONS[mode]), name);
  button.onclick = () => enter(mode, ports).catch((error: unknown) => notice(sentenceOf(error)));
  return button;
}

async function enter(mode: XrMode, ports: XrPorts): Promise<void> {
  const { Immersion } = await import('./immersion.ts');
  await Immersion.begin(mode, ports);
}
