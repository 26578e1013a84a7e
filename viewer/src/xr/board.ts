import * as THREE from 'three';
import { byId } from '../ui/elements.ts';
import { linesOf } from './lines.ts';

const WIDTH = 1024; // pixels
const HEIGHT = 384;
const LETTERS = 42; // pixels
const LINE = 54;
const EDGE = 36;
const MOST_LINES = Math.floor((HEIGHT - EDGE) / LINE);
const WIDE = 0.6; // m, of the board at 1 m
const UNDER = 0.03; // m at 1 m: between the chin and the board
const NEARER = 0.75; // of the way from the visitor to the face

/** A line of text, and whether it is the avatar's. */
interface Line {
  text: string;
  own: boolean;
}

/**
 * The page's captions and notices in space: right below the face as the visitor sees it, from
 * wherever that is, turned to them and of the same apparent size.
 */
export class Board extends THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial> {
  /** What is shown now. */
  text = '';
  private readonly page: ParentNode;
  private hint: string;
  private readonly canvas = document.createElement('canvas');
  private readonly texture: THREE.Texture;
  private readonly observer = new MutationObserver(() => this.write());

  /**
   * @param page where the captions and notices are
   * @param hint is shown, too, until it is followed
   */
  constructor(page: ParentNode, hint: string) {
    const canvas = document.createElement('canvas');
    const texture = new THREE.Texture(canvas);
    texture.colorSpace = THREE.SRGBColorSpace;
    const material = new THREE.MeshBasicMaterial({ map: texture, transparent: true, depthWrite: false });
    super(new THREE.PlaneGeometry(WIDE, (WIDE * HEIGHT) / WIDTH), material);
    this.page = page;
    this.hint = hint;
    this.canvas = canvas;
    this.texture = texture;
    this.renderOrder = 1; // over the Gaussians
    [canvas.width, canvas.height] = [WIDTH, HEIGHT];
    for (const id of ['captions', 'notices']) {
      this.observer.observe(byId(page, id), { subtree: true, childList: true, characterData: true, attributes: true });
    }
    this.write();
  }

  /** The visitor knows what the hint says. */
  dropHint(): void {
    if (!this.hint) return;
    this.hint = '';
    this.write();
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
    const texts = this.read();
    this.text = texts.map(({ text }) => text).join('\n');
    const context = this.canvas.getContext('2d')!;
    context.font = `${LETTERS}px system-ui, sans-serif`;
    const width = (text: string) => context.measureText(text).width;
    const lines = texts.flatMap(({ text, own }) => linesOf(text, WIDTH - 2 * EDGE, width).map((line) => ({ text: line, own })));
    paint(context, lines.slice(-MOST_LINES));
    this.visible = lines.length > 0;
    this.texture.needsUpdate = true;
  }

  /** What the page says now: a notice, else the captions; and the hint. */
  private read(): Line[] {
    const said = (id: string) => byId(this.page, id).textContent?.trim() ?? '';
    const notice = byId(this.page, 'notices').lastElementChild?.textContent?.trim();
    if (notice) return [{ text: notice, own: true }];
    const captions = byId(this.page, 'captions').hidden ? [] : [{ text: said('question'), own: false }, { text: said('answer'), own: true }];
    return [...captions, { text: this.hint, own: false }].filter(({ text }) => text);
  }
}

function paint(context: CanvasRenderingContext2D, lines: readonly Line[]): void {
  context.clearRect(0, 0, WIDTH, HEIGHT);
  context.fillStyle = '#131416c8';
  context.beginPath();
  context.roundRect(0, 0, WIDTH, lines.length * LINE + EDGE, EDGE);
  context.fill();
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  lines.forEach(({ text, own }, i) => {
    context.fillStyle = own ? '#f4f1ec' : '#b9bcc4';
    context.fillText(text, WIDTH / 2, EDGE / 2 + (i + 0.5) * LINE);
  });
}
