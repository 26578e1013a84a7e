import { every } from '../lifetime.ts';
import { byId } from '../ui/elements.ts';
import { isKey, say, type Key, type Sentence } from '../words/text.ts';
import { showAdvice } from './advice.ts';
import { Camera } from './camera.ts';
import { Bodies, type BodyPorts } from './bodies.ts';
import { showMeters, soundsOf } from './meters.ts';
import { isAgreed, showParts, UPLOAD } from './parts.ts';
import type { Overview, Part, Status, Told, Turns } from './recordings.ts';
import { Sending } from './sending.ts';

const LOOKED = 400; // ms between two pictures for guidance
const SHOWN = 250; // ms between two of the clock's
const LONGEST = 60; // s of a part, after which it stops by itself
const SLICE = 4 << 20; // bytes of a video that are sent at once

/** What the view of a person's recording needs of the page around it. */
export interface RoomPorts extends BodyPorts {
  /** A part is chosen. */
  chosen(part: string): void;
  /** Asks a question that is answered by yes or no. */
  confirm(question: Sentence): boolean;
}

/** Where somebody records the parts, brings a video, and has the avatar made. */
export class Room {
  private readonly root: ParentNode;
  private readonly ports: RoomPorts;
  private readonly camera: Camera;
  private readonly bodies: Bodies;
  private status: Status | null = null;
  private current = '';
  private sending: Sending | null = null;
  private saving = false; // a part has ended, and the server looks at it
  private began = 0; // ms, of the recording
  private looking = false;
  private most = 0; // of the turn that is being recorded, 0 to 1

  constructor(root: ParentNode, ports: RoomPorts, signal: AbortSignal) {
    this.root = root;
    this.ports = ports;
    this.camera = new Camera(byId<HTMLVideoElement>(root, 'camera'), () => this.loseCamera());
    this.bodies = new Bodies(root, ports);
    this.on('open', () => this.open());
    this.on('record', () => (this.camera.isRecording ? this.finish() : this.begin()));
    this.on('salvage', () => this.change((name, { id, take }) => ports.recordings.keep(name, id, take!)));
    this.on('remove', () => this.change((name, { id }) => ports.recordings.remove(name, id)));
    this.on('next', async () => this.advance());
    this.on('onward', async () => byId(root, 'make').scrollIntoView({ behavior: 'smooth' }));
    this.on('play', () => this.play());
    this.on('close', async () => byId<HTMLDialogElement>(root, 'shown').close());
    this.on('upload', async () => byId(root, 'file').click());
    byId<HTMLDialogElement>(root, 'shown').onclose = () => byId<HTMLVideoElement>(root, 'replay').removeAttribute('src');
    byId<HTMLInputElement>(root, 'file').onchange = () => void this.upload().catch(ports.failed);
    byId<HTMLFormElement>(root, 'make').onsubmit = (event) => {
      event.preventDefault();
      this.make();
    };
    byId<HTMLSelectElement>(root, 'quality').onchange = () => this.write();
    every(LOOKED, signal, () => void this.look().catch(() => {}));
    every(SHOWN, signal, () => this.showClock());
  }

  /** What the server can do. */
  equip(overview: Overview): void {
    const { qualities, lacking } = overview;
    this.bodies.equip(overview);
    byId(this.root, 'lacking').hidden = lacking === '';
    const options = qualities.map((quality) => {
      const option = new Option(quality, quality, quality === 'good', quality === 'good');
      this.ports.words.write(option, qualityOf(quality));
      return option;
    });
    byId(this.root, 'quality').replaceChildren(...options);
  }

  /** Says of each quality how long it takes, if that is known. */
  private writeQualities({ durations }: Status): void {
    const { options } = byId<HTMLSelectElement>(this.root, 'quality');
    for (const option of options) this.ports.words.write(option, qualityOf(option.value, durations[option.value]));
  }

  /**
   * Shows a person, at the part that is to be recorded next.
   *
   * @param part that is shown instead, if it is one of those
   */
  show(status: Status, part: string | null): void {
    const other = status.name !== this.status?.name;
    this.status = status;
    byId(this.root, 'text').lang = status.language;
    if (other) this.showFirst(status, part);
    else if (this.current === UPLOAD && !this.isBrought) this.current = this.next(status);
    this.bodies.show(status);
    this.write();
  }

  /** Whether the camera records, or a part or a video is on its way. */
  get isBusy(): boolean {
    return this.sending !== null || this.saving;
  }

  private showFirst(status: Status, part: string | null): void {
    const { making } = status;
    if (making) byId<HTMLSelectElement>(this.root, 'quality').value = making.quality;
    const isThere = status.parts.some(({ id, state }) => id === part && (this.isAgreed || id === 'consent') && (id !== UPLOAD || state === 'kept'));
    this.current = isThere ? part! : this.isBrought ? UPLOAD : this.next(status);
  }

  /** Leaves the person; the camera goes off, and of a part that is being recorded stays what was sent. */
  leave(): void {
    this.sending = null;
    this.camera.close();
    this.status = null;
  }

  private get part(): Part | undefined {
    return this.status?.parts.find(({ id }) => id === this.current);
  }

  /** The part after the current one that was not recorded yet; the current one if all were. */
  private next({ parts }: Status): string {
    const open = parts.filter(({ id, state }) => id !== UPLOAD && state !== 'kept'); // consent is the first of all
    return (open[0] ?? parts[0]!).id;
  }

  private advance(): void {
    this.select(this.next(this.status!));
  }

  private on(id: string, act: () => Promise<void>): void {
    byId(this.root, id).onclick = () => void act().catch(this.ports.failed);
  }

  private async open(): Promise<void> {
    this.ports.problem(null);
    await this.camera.open();
    this.hush();
    this.write();
  }

  private async begin(): Promise<void> {
    this.ports.problem(null);
    const { name } = this.status!;
    this.sending = new Sending(this.ports.recordings, name, this.current, (lost) => this.ports.problem(lost ? say('studio.lost') : null));
    [this.began, this.most] = [performance.now(), 0];
    this.camera.record(this.sending, (error) => void this.breakOff(error).catch(this.ports.failed));
    this.write();
  }

  /** Ends a part and keeps it; the next one follows. */
  private async finish(): Promise<void> {
    const sending = this.sending;
    if (!sending) return;
    this.sending = null;
    try {
      const status = await this.saved(sending);
      if (this.status?.name !== status.name) return this.write(); // the page was left for another one
      this.ports.changed(status);
      if (this.part?.advice?.length === 0) this.advance(); // else it is read first
    } catch (error) {
      this.ports.failed(error);
      if (this.status) this.ports.changed(await this.ports.recordings.status(this.status.name));
    }
  }

  /** Ends a part and has it looked at; until then nothing else is done to the parts. */
  private async saved(sending: Sending): Promise<Status> {
    this.saving = true;
    this.write();
    try {
      await this.camera.stop();
      this.write();
      this.ports.words.write(byId(this.root, 'clock'), say('studio.saving'));
      return await sending.keep();
    } finally {
      this.saving = false;
    }
  }

  /** Ends a part that the server does not take; what has arrived of it can still be kept. */
  private async breakOff(error: unknown): Promise<void> {
    if (!this.sending) return;
    this.sending = null;
    await this.camera.stop();
    this.ports.failed(error);
    this.ports.changed(await this.ports.recordings.status(this.status!.name));
  }

  private loseCamera(): void {
    if (this.sending) void this.finish().catch(this.ports.failed);
    this.ports.problem(say('studio.camera.lost'));
    this.write();
  }

  private async change(act: (name: string, part: Part) => Promise<Status>): Promise<void> {
    this.ports.problem(null);
    this.ports.changed(await act(this.status!.name, this.part!));
  }

  private async play(): Promise<void> {
    const video = byId<HTMLVideoElement>(this.root, 'replay');
    video.src = this.ports.recordings.video(this.status!.name, this.current);
    byId<HTMLDialogElement>(this.root, 'shown').showModal();
    await video.play().catch(() => {}); // the person can press the button
  }

  private async upload(): Promise<void> {
    const input = byId<HTMLInputElement>(this.root, 'file');
    const arrived = byId(this.root, 'arrived');
    const file = input.files?.[0];
    input.value = '';
    if (!file) return;
    const { words, recordings, problem, changed } = this.ports;
    const sending = new Sending(recordings, this.status!.name, UPLOAD, (lost) => problem(lost ? say('studio.lost') : null));
    this.sending = sending;
    problem(null);
    arrived.hidden = false;
    try {
      for (let at = 0; at < file.size; at += SLICE) {
        words.write(arrived, say('studio.uploading', { n: Math.floor((100 * at) / file.size) }));
        await sending.add(file.slice(at, at + SLICE));
      }
      words.write(arrived, say('studio.looking'));
      const status = await sending.keep();
      this.current = UPLOAD; // what is wrong with it is read at once
      changed(status);
    } finally {
      arrived.hidden = true;
      if (this.sending === sending) this.sending = null;
    }
    this.reveal();
  }

  /** Has the avatar made; where a making was stopped or failed, from nothing. */
  make(): void {
    const anew = isOver(this.status!);
    if (anew && !this.ports.confirm(say('studio.making.anew.sure'))) return;
    this.ports.problem(null);
    this.ports.recordings.make(this.status!.name, this.quality, anew).then((status) => {
      this.camera.close();
      this.ports.changed(status);
    }, this.ports.failed);
  }

  private get quality(): string {
    return byId<HTMLSelectElement>(this.root, 'quality').value;
  }

  private select(id: string): void {
    if (this.camera.isRecording || this.saving) return;
    this.current = id;
    this.ports.chosen(id);
    this.most = 0;
    this.hush();
    this.write();
    this.reveal();
  }

  /** Scrolls to what the current part asks, if it is not seen. */
  private reveal(): void {
    this.root.querySelector('.set')!.scrollIntoView({ block: 'nearest' });
  }

  /** Says nothing of pictures that are past; instead, if anything, that there are none. */
  private hush(instead?: Key): void {
    const guide = byId(this.root, 'guide');
    this.ports.words.write(guide, instead ? say(instead) : '');
    delete guide.dataset.word;
  }

  private async look(): Promise<void> {
    if (this.looking || !this.status || document.hidden) return;
    this.looking = true;
    try {
      const picture = await this.camera.picture();
      if (picture && this.status) this.tell(await this.ports.recordings.look(this.status.name, this.current, picture));
    } finally {
      this.looking = false;
    }
  }

  private tell({ word, turned }: Told): void {
    const wanted = turned?.[this.current as keyof Turns];
    this.most = Math.max(this.camera.isRecording ? this.most : 0, wanted ?? 0);
    const isEnough = this.camera.isRecording && this.most >= 1 && (word === this.current || word === 'good');
    const key = `studio.guide.${isEnough ? 'enough' : word}`;
    const guide = byId(this.root, 'guide');
    this.ports.words.write(guide, isKey(key) && this.camera.isOpen ? say(key) : '');
    guide.dataset.word = isEnough ? 'good' : word;
    const reached = byId<HTMLProgressElement>(this.root, 'reached');
    reached.hidden = wanted === undefined;
    reached.value = this.most;
  }

  private showClock(): void {
    if (!this.camera.isRecording) return;
    const seconds = Math.floor((performance.now() - this.began) / 1000);
    this.ports.words.write(byId(this.root, 'clock'), say('studio.recording', { n: seconds }));
    this.measure(seconds);
    if (seconds >= LONGEST) void this.finish().catch(this.ports.failed);
  }

  private write(): void {
    const { status, part, camera, root } = this;
    if (!status || !part) return;
    const { words } = this.ports;
    const isText = part.id.startsWith('text-');
    words.write(byId(root, 'task'), say(`studio.task.${isText ? 'text' : part.id}` as Key));
    byId(root, 'text').textContent = part.id === UPLOAD ? '' : part.text;
    words.write(byId(root, 'clock'), '');
    const record = byId<HTMLButtonElement>(root, 'record');
    words.write(record, say(camera.isRecording ? 'studio.stop' : part.state === 'missing' ? 'studio.record' : 'studio.record.again'));
    record.classList.toggle('running', camera.isRecording);
    record.hidden = !camera.isOpen || part.id === UPLOAD;
    byId(root, 'open').hidden = camera.isOpen || part.id === UPLOAD;
    byId(root, 'view').hidden = part.id === UPLOAD;
    byId(root, 'salvage').hidden = camera.isRecording || part.state !== 'broken';
    byId(root, 'next').hidden = camera.isRecording || part.state !== 'kept' || this.isComplete(status);
    byId(root, 'onward').hidden = camera.isRecording || !this.isEnough(status);
    byId(root, 'play').hidden = byId(root, 'remove').hidden = camera.isRecording || part.state === 'missing';
    for (const id of ['record', 'salvage', 'remove', 'upload']) byId<HTMLButtonElement>(root, id).disabled = this.saving;
    showAdvice(byId(root, 'advice'), words, part.advice ?? []);
    showParts(byId(root, 'parts'), words, status.parts, this.current, (id) => this.select(id));
    this.measure(0);
    words.write(byId(root, 'sounds'), soundsOf(status.covered));
    byId(root, 'covered').hidden = this.isBrought; // the parts do not count then
    this.writeMake(status);
    byId<HTMLButtonElement>(root, 'upload').disabled ||= !this.isAgreed;
    if (!camera.isOpen) this.hush('studio.camera.off');
    byId(root, 'reached').hidden ||= !camera.isOpen;
  }

  /** Shows what is covered, with so many seconds of what is being recorded. */
  private measure(seconds: number): void {
    if (!this.status) return;
    const now = this.camera.isRecording ? { part: this.current, seconds } : null;
    showMeters(byId(this.root, 'meters'), this.ports.words, this.status, now);
  }

  /** Shows whether the avatar can be made, and what the button does. */
  private writeMake(status: Status): void {
    const { words } = this.ports;
    this.writeQualities(status);
    const ready = this.isReady(status);
    const { making } = status;
    const isSame = making?.state === 'made' && making.changed.length === 0 && making.quality === this.quality;
    const go = byId<HTMLButtonElement>(this.root, 'go');
    go.disabled = !ready || isSame || this.camera.isRecording || this.saving;
    words.write(go, say(isOver(status) ? 'studio.making.anew' : making || status.avatar ? 'studio.make.again' : 'studio.make'));
    words.write(byId(this.root, 'first'), isSame ? say('studio.make.same') : ready ? this.more(status) : say('studio.make.first'));
  }

  /** Whether the person said that they agree: that comes before all else. */
  private get isAgreed(): boolean {
    return isAgreed(this.status!.parts);
  }

  private isReady({ parts }: Status): boolean {
    return this.isAgreed && parts.filter(({ state }) => state === 'kept').length > 1;
  }

  /** Whether there is a video that takes the place of the parts. */
  private get isBrought(): boolean {
    return this.status!.parts.some(({ id, state }) => id === UPLOAD && state === 'kept');
  }

  /** What is said of an avatar that could be made: that more would be better, as long as it would. */
  private more(status: Status): Sentence {
    return this.isEnough(status) ? '' : say('studio.make.more');
  }

  /** Whether an avatar can be made that would hardly be better of more. */
  private isEnough(status: Status): boolean {
    return this.isReady(status) && (this.isBrought || status.covered.seconds >= status.covered.enough);
  }

  private isComplete({ parts }: Status): boolean {
    return parts.every(({ id, state }) => id === UPLOAD || state === 'kept');
  }
}

/**
 * What a quality is called.
 *
 * @param seconds that it takes, if anybody knows
 */
export function qualityOf(quality: string, seconds?: number): Sentence {
  const name = say(`studio.quality.${quality}` as Key);
  return seconds === undefined ? name : say('studio.quality.time', { quality: name, n: Math.max(Math.round(seconds / 60), 1) });
}

/** Whether a making has ended without an avatar. */
function isOver({ making }: Status): boolean {
  return making?.state === 'stopped' || making?.state === 'failed';
}
