import * as THREE from 'three';
import { byId } from '../ui/elements.ts';
import { linesOf } from './lines.ts';

const WIDTH = 1024; // pixels
const HEIGHT = 384;
const LETTERS = 42; // pixels
const LINE = 54;
const EDGE = 36;
const MOST_LINES = Math.floor((HEIGHT - EDGE) / LINE);
const MOST_TOLD = 3; // lines of a notice: captions have the rest
/** Letters of a long text after which its lines are made of another part of it; the board has room for some 300. */
const PART = 1000;
const WIDE = 0.6; // m, of the board at 1 m
const UNDER = 0.03; // m at 1 m: between the chin and the board
const NEARER = 0.75; // of the way from the visitor to the face

const TOLD = ['listening', 'thinking']; // states of a talk

/** A text, whether it is the avatar's, and how many of its letters are seen. */
interface Said {
  text: string;
  own: boolean;
  seen: number;
}

/**
 * The page's notices, and its captions under them, in space: right below the face as the visitor sees it, from
 * wherever that is, turned to them and of the same apparent size.
 */
export class Board extends THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial> {
  /** What is shown now. */
  text = '';
  private readonly page: ParentNode;
  private hint = '';
  private way = ''; // back to who is not seen
  private readonly canvas = document.createElement('canvas');
  private readonly texture: THREE.Texture;
  private isNew = false; // what the page says, since it was written
  private readonly observer = new MutationObserver(() => (this.isNew = true));

  /** @param page where the captions and notices are */
  constructor(page: ParentNode) {
    const canvas = document.createElement('canvas');
    const texture = new THREE.Texture(canvas);
    texture.colorSpace = THREE.SRGBColorSpace;
    const material = new THREE.MeshBasicMaterial({ map: texture, transparent: true, depthWrite: false });
    super(new THREE.PlaneGeometry(WIDE, (WIDE * HEIGHT) / WIDTH), material);
    this.page = page;
    this.canvas = canvas;
    this.texture = texture;
    this.renderOrder = 1; // over the Gaussians
    [canvas.width, canvas.height] = [WIDTH, HEIGHT];
    for (const id of ['captions', 'notices', 'line', 'state']) {
      this.observer.observe(byId(page, id), { subtree: true, childList: true, characterData: true, attributes: true });
    }
    this.write();
  }

  /** Says how the visitor talks, goes and leaves; nothing by an empty text. */
  advise(hint: string): void {
    if (hint === this.hint) return;
    this.hint = hint;
    this.write();
  }

  /** Says how a visitor who is lost comes back; nothing by an empty text. */
  guide(way: string): void {
    if (way === this.way) return;
    this.way = way;
    this.write();
  }

  /** Writes what the page says anew; called for each picture, between which many messages may come. */
  follow(): void {
    if (this.isNew) this.write();
  }

  /** Goes below a face: all in world space, m. */
  place(visitor: THREE.Vector3, chin: THREE.Vector3, up: THREE.Vector3): void {
    const sight = chin.clone().sub(visitor).multiplyScalar(NEARER);
    const away = sight.length();
    const back = sight.clone().divideScalar(-away);
    const upward = up.clone().projectOnPlane(back).normalize();
    const drop = away * (UNDER + (WIDE * HEIGHT) / WIDTH / 2);
    this.position.copy(visitor).add(sight).addScaledVector(upward, -drop);
    this.quaternion.setFromRotationMatrix(new THREE.Matrix4().makeBasis(upward.clone().cross(back), upward, back));
    this.scale.setScalar(away);
  }

  dispose(): void {
    this.observer.disconnect();
    this.texture.dispose();
    this.geometry.dispose();
    this.material.dispose();
  }

  private write(): void {
    this.isNew = false;
    const [told, said] = this.read();
    this.text = [...told, ...said].map(({ text, seen }) => text.slice(0, seen)).join('\n');
    const context = this.canvas.getContext('2d')!;
    context.font = `${LETTERS}px system-ui, sans-serif`;
    const width = (text: string) => context.measureText(text).width;
    const inLines = (texts: Said[]) => texts.map(part).flatMap((one) => seenLines(one, linesOf(one.text, WIDTH - 2 * EDGE, width)));
    const above = inLines(told).slice(0, MOST_TOLD);
    const lines = inLines(said);
    const room = MOST_LINES - above.length;
    const end = Math.max(room, 1 + lines.findLastIndex(({ seen }) => seen > 0));
    const shown = [...above, ...lines.slice(Math.max(0, end - room), end)];
    paint(context, shown);
    this.visible = shown.length > 0;
    this.texture.needsUpdate = true;
  }

  /** That somebody listens or thinks: in space no other thing tells. */
  private state(): string {
    const state = byId(this.page, 'state');
    const { state: name = '' } = state.closest<HTMLElement>('[data-state]')?.dataset ?? {};
    return TOLD.includes(name) ? state.textContent! : '';
  }

  /** What the page says now: a notice, which stands above; the captions, who listens, and the hint. */
  private read(): [told: Said[], said: Said[]] {
    const [captions, notices, line] = [byId(this.page, 'captions'), byId(this.page, 'notices'), byId(this.page, 'line')];
    const notice = notices.lastElementChild?.textContent ?? line.textContent!;
    const shown = captions.checkVisibility() ? [said(byId(captions, 'question'), false), said(byId(captions, 'answer'), true)] : [];
    const talk = [...shown, whole(this.state(), false), whole(this.way || this.hint, false)];
    return [[whole(notice, false)], talk].map((texts) => texts.filter(({ text }) => text)) as [Said[], Said[]];
  }
}

/** A text in single spaces, so that its lines are parts of it. */
function tidy(text: string): string {
  return text.replace(/\s+/g, ' ').trim();
}

function whole(text: string, own: boolean): Said {
  return { text: tidy(text), own, seen: Infinity };
}

/** What an element of the captions says; words that were not heard yet keep their place. */
function said(element: HTMLElement, own: boolean): Said {
  const unheard = element.querySelector('.unheard')?.textContent ?? '';
  const text = element.textContent ?? '';
  return { text: tidy(text), own, seen: tidy(text.slice(0, text.length - unheard.length)).length };
}

/** Of a long text the part that is seen: from some letters before the last one that was heard, else its beginning. */
function part({ text, own, seen }: Said): Said {
  const from = seen <= text.length ? PART * Math.max(0, Math.floor(seen / PART) - 1) : 0;
  return { text: text.slice(from, from + 3 * PART).trim(), own, seen: seen - from };
}

/** How much of each line of a text is seen. */
function seenLines({ text, own, seen }: Said, lines: readonly string[]): Said[] {
  let from = 0;
  return lines.map((line) => {
    const begin = text.indexOf(line, from);
    from = begin + line.length;
    return { text: line, own, seen: Math.min(line.length, Math.max(0, seen - begin)) };
  });
}

function paint(context: CanvasRenderingContext2D, lines: readonly Said[]): void {
  context.clearRect(0, 0, WIDTH, HEIGHT);
  context.fillStyle = '#131416c8';
  context.beginPath();
  context.roundRect(0, 0, WIDTH, lines.length * LINE + EDGE, EDGE);
  context.fill();
  context.textBaseline = 'middle';
  lines.forEach(({ text, own, seen }, i) => {
    context.fillStyle = own ? '#f4f1ec' : '#b9bcc4';
    context.fillText(text.slice(0, seen), (WIDTH - context.measureText(text).width) / 2, EDGE / 2 + (i + 0.5) * LINE);
  });
}
