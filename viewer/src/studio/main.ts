import '../ui/style/page.css';
import '../ui/style/buttons.css';
import '../ui/style/scrolling.css';
import '../ui/style/theme.css';
import './studio.css';
import './bodies.css';
import { admit, byKey } from '../admission.ts';
import { sentenceOf } from '../errors.ts';
import { every } from '../lifetime.ts';
import { rememberedInTab, rememberInTab } from '../remembered.ts';
import { Server } from '../server.ts';
import { byId } from '../ui/elements.ts';
import { offerLanguages } from '../ui/sheets/languages.ts';
import { followTheme } from '../ui/theme.ts';
import { PageWords } from '../words/page-words.ts';
import studio from '../words/studio.json';
import { addTexts, say, type Sentence } from '../words/text.ts';
import { MakingView } from './making.ts';
import { Place } from './place.ts';
import { Recordings, Refusal, type Overview, type Status } from './recordings.ts';
import { Room } from './room/room.ts';

const KEY = 'studio-key'; // under which the tab keeps it: who comes back from the talk does not bring it
const UNADMITTED = 401;
const UNKNOWN = 404;
const WATCHED = 5000; // ms between two looks whether somebody is still there, and what other tabs have changed

addTexts(studio);
const root = document.documentElement;
const words = new PageWords(root);
const { signal } = new AbortController(); // as long as the page is there
const secrets = new URLSearchParams(location.hash.slice(1)); // what browsers send nowhere
const server = new Server(new URL(location.href));
const recordings = new Recordings(server);
const place = new Place();
let overview: Overview | null = null;
let person: Status | null = null;
const deleted = new Set<string>(); // whom this page has deleted, and nobody else

const ports = {
  words,
  recordings,
  problem,
  failed,
  changed: showPerson,
  chosen: (part: string) => place.choose(part),
  confirm: (question: Sentence) => confirm(words.text(question)),
  anew: () => room.make(),
};
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
  await leaveDeleted(name);
}

/** Says of somebody whose recordings are gone that a new one can begin. */
async function leaveDeleted(name: string): Promise<void> {
  await showStart();
  tellDeleted(name);
  byId(root, 'name').focus();
}

/** Says that somebody is gone: as wished, or to the surprise of whoever looks at the page. */
function tellDeleted(name: string): void {
  const isWished = deleted.has(name);
  problem(say(isWished ? 'studio.deleted' : 'studio.gone', { name }));
  byId(root, 'problem').classList.toggle('told', isWished);
}

/** Looks what has become of the person meanwhile, unless something of them is on its way. */
async function watch(): Promise<void> {
  const name = person?.name;
  if (name === undefined || document.hidden || room.isBusy) return;
  try {
    const now = await recordings.status(name);
    const isOther = JSON.stringify(now) !== JSON.stringify(person);
    if (isOther && person?.name === name && !room.isBusy) showPerson(now);
  } catch (error) {
    if (isUnknown(error) && person?.name === name) await leaveDeleted(name);
  }
}

function show(...sections: string[]): void {
  for (const id of ['door', 'start', 'room', 'making']) byId(root, id).hidden = !sections.includes(id);
  byId(root, 'back').hidden = byId(root, 'delete').hidden = person === null;
}

/** Shows a person: what is recorded, and the avatar as it is made. */
function showPerson(status: Status): void {
  person = status;
  deleted.delete(status.name); // begun anew
  place.open(status.name);
  const state = status.making?.state;
  show(...(state || status.avatar ? ['making'] : []), ...(state === 'running' ? [] : ['room']));
  words.write(byId(root, 'title'), status.name);
  words.write(byId(root, 'delete'), say('studio.delete', { name: status.name }));
  room.show(status, place.part);
  making.show(status);
}

/** Shows whose recordings there are, and where a new one begins. */
async function showStart(): Promise<void> {
  room.leave();
  making.show(null);
  person = null;
  place.open(null);
  words.write(byId(root, 'title'), say('studio.title'));
  await equip();
  const names = overview!.people.map((name) => {
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

/** Asks whose recordings there are, and what the server can do. */
async function equip(): Promise<void> {
  overview = await recordings.overview();
  room.equip(overview);
}

/** Shows what the address of the page says: somebody's recording, or where one begins. */
async function showPlace(): Promise<void> {
  const name = place.person;
  if (name === null) return showStart();
  room.leave();
  making.show(null);
  await equip();
  const status = await recordings.status(name).catch((error) => {
    if (isUnknown(error)) return null;
    throw error;
  });
  await (status ? showPerson(status) : leaveDeleted(name));
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
    if (key) rememberInTab(KEY, key);
    await showPlace();
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
  const leaving = person!;
  const { name } = leaving;
  if (!confirm(words.text(say('studio.delete.sure', { name })))) return;
  person = null; // that they are gone is no surprise now
  making.show(null);
  try {
    await recordings.delete(name);
    deleted.add(name);
    await showStart();
    tellDeleted(name);
  } catch (error) {
    showPerson(leaving);
    failed(error);
  }
};
addEventListener('popstate', () => {
  problem(null);
  void showPlace().catch(failed);
});
addEventListener('beforeunload', (event) => {
  if (room.isBusy) event.preventDefault(); // the browser asks whether to leave
});
addEventListener('pageshow', ({ persisted }) => persisted && void watch()); // the browser's Back
document.addEventListener('visibilitychange', () => void watch());
every(WATCHED, signal, () => void watch());
offerLanguages(byId(root, 'language'), words, signal);
followTheme(root, () => {}, signal);
void enter(secrets.get('key') ?? rememberedInTab(KEY));
