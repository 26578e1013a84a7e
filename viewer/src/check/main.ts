import '../ui/style/page.css';
import '../ui/style/buttons.css';
import './check.css';
import { Server } from '../server.ts';
import { byId } from '../ui/elements.ts';
import { report, summary, type Finding } from './finding.ts';
import { checkHeadset } from './headset.ts';
import { Line } from './lines.ts';
import { checkSecurity, checkSocket } from './network.ts';
import { checkFrames, checkGraphics } from './picture.ts';
import { checkMicrophone, judgeTone, playTone } from './sound.ts';

const LOUD = 0.3; // level at which the meter is full

const findings = new Map<string, Finding | null>();
const list = byId(document, 'lines');
const text = byId<HTMLTextAreaElement>(document, 'report');

/** Makes a line; what is shown there goes into the report. */
function lineOf(id: string, title: string): { line: Line; found: (finding: Finding) => void } {
  const line = new Line(list, id, title);
  findings.set(title, null);
  const found = (finding: Finding) => {
    findings.set(title, finding);
    line.show(finding);
    write();
  };
  return { line, found };
}

function write(): void {
  const known = [...findings.values()].filter((finding) => finding !== null);
  byId(document, 'summary').textContent = summary(known);
  const screen = `Window: ${innerWidth} × ${innerHeight}, ${devicePixelRatio} pixels per point`;
  text.value = report(findings, [navigator.userAgent, screen]);
}

const security = lineOf('secure', 'Page');
const graphics = lineOf('graphics', 'Graphics');
const frames = lineOf('frames', 'Frames');
const socket = lineOf('socket', 'Connection');
const sound = lineOf('sound', 'Sound');
const microphone = lineOf('microphone', 'Microphone');
const headset = lineOf('headset', 'Headset');

sound.line.ask('Is it heard what the avatar says?');
const play = sound.line.button('Play a tone', async () => {
  play.disabled = true;
  const failed = await playTone();
  play.disabled = false;
  answers.hidden = failed !== null;
  if (failed) sound.found(failed);
  else {
    sound.line.ask('Did you hear the tone?');
    yes.focus();
  }
});
const answers = document.createElement('span');
sound.line.acts.append(answers);
const [yes, no] = [true, false].map((heard) => {
  const button = sound.line.button(heard ? 'Yes' : 'No', () => {
    answers.hidden = true;
    sound.found(judgeTone(heard));
    play.focus();
  });
  answers.append(button, ' ');
  return button;
}) as [HTMLButtonElement, HTMLButtonElement];
no.id = 'unheard';
yes.id = 'heard';
answers.hidden = true;

microphone.line.ask('Press the button, allow the microphone, and say something.');
const meter = document.createElement('meter');
[meter.max, meter.ariaLabel, meter.hidden] = [LOUD, 'Level of the microphone', true];
const listen = microphone.line.button('Try the microphone', async () => {
  listen.disabled = true;
  meter.hidden = false;
  microphone.line.ask('Listening: say something …');
  microphone.found(await checkMicrophone((level) => (meter.value = level)));
  meter.hidden = true;
  listen.disabled = false;
});
microphone.line.acts.append(meter);

byId(document, 'copy').onclick = ({ target }) => {
  text.select();
  const copied = document.execCommand('copy'); // `navigator.clipboard` is missing where the page is not trusted
  (target as HTMLButtonElement).textContent = copied ? 'Copied' : 'Selected: copy it now';
};

security.found(checkSecurity());
graphics.found(checkGraphics());
const checks: [typeof frames, Promise<Finding>][] = [
  [headset, checkHeadset()],
  [socket, checkSocket(new Server(new URL(location.href)).echo())],
  [frames, checkFrames()],
];
for (const [{ found }, finding] of checks) void finding.then(found);
