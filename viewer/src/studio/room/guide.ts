import { every } from '../../lifetime.ts';
import { byId } from '../../ui/elements.ts';
import type { PageWords } from '../../words/page-words.ts';
import { isKey, say, type Key } from '../../words/text.ts';
import type { Recordings, Told, Turns } from '../recordings.ts';
import type { Camera } from './camera.ts';

const LOOKED = 400; // ms between two pictures for guidance

/** What guidance needs of the page around it. */
export interface GuidePorts {
  words: PageWords;
  recordings: Recordings;
}

/** Who is before the camera, and what they are to do. */
export interface Subject {
  name: string;
  part: string;
}

/** Says to somebody before the camera what would be better, or that it is enough, by pictures that the server looks at. */
export class Guide {
  private readonly root: ParentNode;
  private readonly ports: GuidePorts;
  private readonly camera: Camera;
  private readonly subject: () => Subject | null;
  private looking = false;
  private most = 0; // of the turn that is being recorded, 0 to 1

  /** @param subject tells who is there; null for nobody */
  constructor(root: ParentNode, ports: GuidePorts, camera: Camera, subject: () => Subject | null, signal: AbortSignal) {
    this.root = root;
    this.ports = ports;
    this.camera = camera;
    this.subject = subject;
    every(LOOKED, signal, () => void this.look().catch(() => {}));
  }

  /** A part begins: nobody has turned yet. */
  begin(): void {
    this.most = 0;
  }

  /** Says nothing of pictures that are past; instead, if anything, that there are none. */
  hush(instead?: Key): void {
    const guide = byId(this.root, 'guide');
    this.ports.words.write(guide, instead ? say(instead) : '');
    delete guide.dataset.word;
  }

  /** Says that there are no pictures, where the camera is off. */
  show(): void {
    if (this.camera.isOpen) return;
    this.hush('studio.camera.off');
    byId(this.root, 'reached').hidden = true;
  }

  private async look(): Promise<void> {
    if (this.looking || !this.subject() || document.hidden) return;
    this.looking = true;
    try {
      const picture = await this.camera.picture();
      const subject = this.subject();
      if (picture && subject) this.tell(await this.ports.recordings.look(subject.name, subject.part, picture));
    } finally {
      this.looking = false;
    }
  }

  private tell({ word, turned }: Told): void {
    const { camera, root } = this;
    const part = this.subject()?.part;
    const wanted = turned?.[part as keyof Turns];
    this.most = Math.max(camera.isRecording ? this.most : 0, wanted ?? 0);
    const isEnough = camera.isRecording && this.most >= 1 && (word === part || word === 'good');
    const key = `studio.guide.${isEnough ? 'enough' : word}`;
    const guide = byId(root, 'guide');
    this.ports.words.write(guide, isKey(key) && camera.isOpen ? say(key) : '');
    guide.dataset.word = isEnough ? 'good' : word;
    const reached = byId<HTMLProgressElement>(root, 'reached');
    reached.hidden = wanted === undefined;
    reached.value = this.most;
  }
}
