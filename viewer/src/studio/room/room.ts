import { every } from '../../lifetime.ts';
import { byId } from '../../ui/elements.ts';
import { say, type Key } from '../../words/text.ts';
import { showAdvice } from '../advice.ts';
import { Bodies, type BodyPorts } from '../bodies.ts';
import type { Overview, Part, Status } from '../recordings.ts';
import { Camera } from './camera.ts';
import { Guide } from './guide.ts';
import { MakeForm, type MakePorts } from './make-form.ts';
import { showMeters, soundsOf } from './meters.ts';
import { isAgreed, showParts, UPLOAD } from './parts.ts';
import { isBrought, isComplete, isEnough, mayChoose, nextPart } from './readiness.ts';
import { Sending } from './sending.ts';

const SHOWN = 250; // ms between two of the clock's
const LONGEST = 60; // s of a part, after which it stops by itself

/** What the view of a person's recording needs of the page around it. */
export interface RoomPorts extends BodyPorts, MakePorts {
  /** A part is chosen. */
  chosen(part: string): void;
}

/** Where somebody records the parts, brings a video, and has the avatar made. */
export class Room {
  private readonly root: ParentNode;
  private readonly ports: RoomPorts;
  private readonly camera: Camera;
  private readonly guide: Guide;
  private readonly bodies: Bodies;
  private readonly form: MakeForm;
  private status: Status | null = null;
  private current = '';
  private sending: Sending | null = null;
  private saving = false; // a part has ended, and the server looks at it
  private began = 0; // ms, of the recording

  constructor(root: ParentNode, ports: RoomPorts, signal: AbortSignal) {
    this.root = root;
    this.ports = ports;
    this.camera = new Camera(byId<HTMLVideoElement>(root, 'camera'), () => this.loseCamera());
    this.guide = new Guide(root, ports, this.camera, () => this.status && { name: this.status.name, part: this.current }, signal);
    this.bodies = new Bodies(root, ports);
    this.form = new MakeForm(root, ports, (status) => this.beginMaking(status));
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
    every(SHOWN, signal, () => this.showClock());
  }

  /** What the server can do. */
  equip(overview: Overview): void {
    this.bodies.equip(overview);
    this.form.equip(overview.qualities);
    byId(this.root, 'lacking').hidden = overview.lacking === '';
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
    else if (this.current === UPLOAD && !isBrought(status)) this.current = nextPart(status);
    this.bodies.show(status);
    this.write();
  }

  /** Whether the camera records, or a part or a video is on its way. */
  get isBusy(): boolean {
    return this.sending !== null || this.saving;
  }

  private showFirst(status: Status, part: string | null): void {
    if (status.making) this.form.choose(status.making.quality);
    this.current = mayChoose(status, part) ? part : isBrought(status) ? UPLOAD : nextPart(status);
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

  private advance(): void {
    this.select(nextPart(this.status!));
  }

  private on(id: string, act: () => Promise<void>): void {
    byId(this.root, id).onclick = () => void act().catch(this.ports.failed);
  }

  private async open(): Promise<void> {
    this.ports.problem(null);
    await this.camera.open();
    this.guide.hush();
    this.write();
  }

  private async begin(): Promise<void> {
    this.ports.problem(null);
    const { name } = this.status!;
    this.sending = new Sending(this.ports.recordings, name, this.current, (lost) => this.ports.problem(lost ? say('studio.lost') : null));
    this.began = performance.now();
    this.guide.begin();
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
      await sending.addVideo(file, (percent) => words.write(arrived, say('studio.uploading', { n: percent })));
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
    this.form.make();
  }

  private beginMaking(status: Status): void {
    this.camera.close();
    this.ports.changed(status);
  }

  private select(id: string): void {
    if (this.camera.isRecording || this.saving) return;
    this.current = id;
    this.ports.chosen(id);
    this.guide.begin();
    this.guide.hush();
    this.write();
    this.reveal();
  }

  /** Scrolls to what the current part asks, if it is not seen. */
  private reveal(): void {
    this.root.querySelector('.set')!.scrollIntoView({ block: 'nearest' });
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
    byId(root, 'next').hidden = camera.isRecording || part.state !== 'kept' || isComplete(status);
    byId(root, 'onward').hidden = camera.isRecording || !isEnough(status);
    byId(root, 'play').hidden = byId(root, 'remove').hidden = camera.isRecording || part.state === 'missing';
    for (const id of ['record', 'salvage', 'remove', 'upload']) byId<HTMLButtonElement>(root, id).disabled = this.saving;
    showAdvice(byId(root, 'advice'), words, part.advice ?? []);
    showParts(byId(root, 'parts'), words, status.parts, this.current, (id) => this.select(id));
    this.measure(0);
    words.write(byId(root, 'sounds'), soundsOf(status.covered));
    byId(root, 'covered').hidden = isBrought(status); // the parts do not count then
    this.form.show(status, camera.isRecording || this.saving);
    byId<HTMLButtonElement>(root, 'upload').disabled ||= !isAgreed(status.parts);
    this.guide.show();
  }

  /** Shows what is covered, with so many seconds of what is being recorded. */
  private measure(seconds: number): void {
    if (!this.status) return;
    const now = this.camera.isRecording ? { part: this.current, seconds } : null;
    showMeters(byId(this.root, 'meters'), this.ports.words, this.status, now);
  }
}
