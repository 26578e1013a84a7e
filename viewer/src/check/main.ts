import '../ui/style/page.css';
import '../ui/style/buttons.css';
import '../ui/style/scrolling.css';
import '../ui/style/theme.css';
import './check.css';
import { Server } from '../server.ts';
import { seeGraphics } from '../soft/graphics.ts';
import { byId } from '../ui/elements.ts';
import { offerLanguages } from '../ui/sheets/languages.ts';
import { followTheme } from '../ui/theme.ts';
import { PageWords } from '../words/page-words.ts';
import { say, type Message } from '../words/text.ts';
import { report, summary, type Finding } from './finding.ts';
import { checkHeadset } from './headset.ts';
import { Line } from './lines.ts';
import { checkSecurity, checkSocket } from './network.ts';
import { checkFrames, judgeGraphics } from './picture.ts';
import { checkMicrophone, judgeTone, playTone } from './sound.ts';

const LOUD = 0.3; // level at which the meter is full

const findings = new Map<Message, Finding | null>();
const words = new PageWords(document.documentElement);
const { signal } = new AbortController(); // as long as the page is there
offerLanguages(byId(document, 'language'), words, signal);
followTheme(document.documentElement, () => {}, signal);
const list = byId(document, 'lines');
const text = byId<HTMLTextAreaElement>(document, 'report');

/** Makes a line; what is shown there goes into the report. */
function lineOf(id: string, title: Message): { line: Line; found: (finding: Finding) => void } {
  const line = new Line(list, words, id, title);
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
  words.write(byId(document, 'summary'), summary(known));
  const screen = `Window: ${innerWidth} × ${innerHeight}, ${devicePixelRatio} pixels per point`;
  text.value = report(findings, [navigator.userAgent, screen]);
}

const security = lineOf('secure', say('check.secure'));
const graphics = lineOf('graphics', say('check.graphics'));
const frames = lineOf('frames', say('check.frames'));
const socket = lineOf('socket', say('check.socket'));
const sound = lineOf('sound', say('check.sound'));
const microphone = lineOf('microphone', say('microphone'));
const headset = lineOf('headset', say('check.headset'));

sound.line.ask(say('check.sound.ask'));
const play = sound.line.button(say('check.sound.play'), async () => {
  play.disabled = true;
  const failed = await playTone();
  play.disabled = false;
  answers.hidden = failed !== null;
  if (failed) sound.found(failed);
  else {
    sound.line.ask(say('check.sound.heard'));
    yes.focus();
  }
});
const answers = document.createElement('span');
sound.line.acts.append(answers);
const [yes, no] = [true, false].map((heard) => {
  const button = sound.line.button(say(heard ? 'check.yes' : 'check.no'), () => {
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

microphone.line.ask(say('check.microphone.ask'));
const meter = document.createElement('meter');
[meter.max, meter.hidden] = [LOUD, true];
words.write(meter, say('check.microphone.level'), 'label');
const listen = microphone.line.button(say('check.microphone.try'), async () => {
  listen.disabled = true;
  meter.hidden = false;
  microphone.line.ask(say('check.microphone.listening'));
  microphone.found(await checkMicrophone((level) => (meter.value = level)));
  meter.hidden = true;
  listen.disabled = false;
});
microphone.line.acts.append(meter);

byId(document, 'copy').onclick = ({ target }) => {
  text.select();
  const copied = document.execCommand('copy'); // `navigator.clipboard` is missing where the page is not trusted
  words.write(target as HTMLButtonElement, say(copied ? 'transcript.copied' : 'check.selected'));
};

security.found(checkSecurity());
const card = seeGraphics();
graphics.found(judgeGraphics(card));
const checks: [typeof frames, Promise<Finding>][] = [
  [headset, checkHeadset()],
  [socket, checkSocket(new Server(new URL(location.href)).echo())],
  [frames, checkFrames(card)],
];
for (const [{ found }, finding] of checks) void finding.then(found);
