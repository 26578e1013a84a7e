import '../ui/style/page.css';
import '../ui/style/buttons.css';
import '../ui/style/scrolling.css';
import '../ui/style/theme.css';
import './studio.css';
import { admit, byKey } from '../admission.ts';
import { sentenceOf } from '../errors.ts';
import { Server } from '../server.ts';
import { byId } from '../ui/elements.ts';
import { offerLanguages } from '../ui/sheets/languages.ts';
import { followTheme } from '../ui/theme.ts';
import { PageWords } from '../words/page-words.ts';
import studio from '../words/studio.json';
import { addTexts, say, type Sentence } from '../words/text.ts';
import { MakingView } from './making.ts';
import { Recordings, Refusal, type Overview, type Status } from './recordings.ts';
import { Room } from './room.ts';

const UNADMITTED = 401;
const UNKNOWN = 404;

addTexts(studio);
const root = document.documentElement;
const words = new PageWords(root);
const { signal } = new AbortController(); // as long as the page is there
const secrets = new URLSearchParams(location.hash.slice(1)); // what browsers send nowhere
const server = new Server(new URL(location.href));
const recordings = new Recordings(server);
let overview: Overview | null = null;
let person: Status | null = null;

const ports = { words, recordings, problem, failed, changed: showPerson };
const room = new Room(root, ports, signal);
const making = new MakingView(root, ports, signal);

/** Shows what is wrong; null: nothing. */
function problem(sentence: Sentence | null): void {
  const shown = byId(root, 'problem');
  shown.hidden = sentence === null;
  shown.classList.remove('told');
  words.write(shown, sentence ?? '');
}

function failed(error: unknown): void {
  problem(sentenceOf(error));
  if (isUnknown(error)) void leaveIfGone().catch(failed);
}

function isUnknown(error: unknown): boolean {
  return error instanceof Refusal && error.status === UNKNOWN;
}

/** Leaves a person who was deleted elsewhere, in another tab or by hand. */
async function leaveIfGone(): Promise<void> {
  const name = person?.name;
  if (name === undefined) return;
  const isGone = await recordings.status(name).then(() => false, isUnknown);
  if (!isGone || person?.name !== name) return;
  await showStart();
  problem(say('studio.deleted', { name }));
}

function show(...sections: string[]): void {
  for (const id of ['door', 'start', 'room', 'making']) byId(root, id).hidden = !sections.includes(id);
  byId(root, 'back').hidden = byId(root, 'delete').hidden = person === null;
}

/** Shows a person: what is recorded, and the avatar as it is made. */
function showPerson(status: Status): void {
  person = status;
  const state = status.making?.state;
  show(...(state ? ['making'] : []), ...(state === 'running' ? [] : ['room']));
  words.write(byId(root, 'title'), status.name);
  words.write(byId(root, 'delete'), say('studio.delete', { name: status.name }));
  room.show(status);
  making.show(status);
}

/** Shows whose recordings there are, and where a new one begins. */
async function showStart(): Promise<void> {
  room.leave();
  making.show(null);
  person = null;
  words.write(byId(root, 'title'), say('studio.title'));
  overview = await recordings.overview();
  room.equip(overview);
  const names = overview.people.map((name) => {
    const row = document.createElement('li');
    const button = document.createElement('button');
    button.textContent = name;
    button.onclick = () => {
      problem(null);
      void recordings.status(name).then(showPerson).catch(failed);
    };
    row.append(button);
    return row;
  });
  byId(root, 'people').replaceChildren(...names);
  byId(root, 'known').hidden = names.length === 0;
  byId<HTMLFormElement>(root, 'consent').reset();
  showSentence();
  show('start');
}

/** The sentences to agree to, with the name as far as it is typed. */
function showSentence(): void {
  const name = byId<HTMLInputElement>(root, 'name').value.trim() || '____';
  byId(root, 'sentence').textContent = overview?.consent[words.language]?.replace('{name}', name) ?? '';
  const voice = overview?.voice[words.language] ?? '';
  byId(root, 'voice-tick').hidden = voice === '';
  byId(root, 'voice-sentence').textContent = voice;
  byId(root, 'mute').hidden = !overview?.mute;
}

/** Gets in by the key, if there is one, and begins; asks for it where it is needed. */
async function enter(key: string | null): Promise<void> {
  try {
    if (key) await admit(server, byKey(server, key), say('error.key'), signal);
    await showStart();
  } catch (error) {
    const isLocked = key !== null || (error instanceof Refusal && error.status === UNADMITTED);
    if (isLocked) show('door');
    if (key !== null || !isLocked) failed(error);
  }
}

byId<HTMLInputElement>(root, 'name').oninput = showSentence;
words.onChange(showSentence, signal);
byId<HTMLFormElement>(root, 'consent').onsubmit = (event) => {
  event.preventDefault();
  problem(null);
  const [agreed, voice] = ['agreed', 'voice'].map((id) => byId<HTMLInputElement>(root, id).checked);
  void recordings.begin(byId<HTMLInputElement>(root, 'name').value, words.language, agreed!, voice!).then(showPerson).catch(failed);
};
byId<HTMLFormElement>(root, 'door').onsubmit = (event) => {
  event.preventDefault();
  problem(null);
  void enter(byId<HTMLInputElement>(root, 'key').value.trim());
};
byId(root, 'back').onclick = () => {
  problem(null);
  void showStart().catch(failed);
};
byId(root, 'delete').onclick = async () => {
  const { name } = person!;
  if (!confirm(words.text(say('studio.delete.sure', { name })))) return;
  try {
    await recordings.delete(name);
    await showStart();
    problem(say('studio.deleted', { name }));
    byId(root, 'problem').classList.add('told');
  } catch (error) {
    failed(error);
  }
};
offerLanguages(byId(root, 'language'), words, signal);
followTheme(root, () => {}, signal);
void enter(secrets.get('key'));
