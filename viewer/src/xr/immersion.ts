import * as THREE from 'three';
import { PageError } from '../errors.ts';
import { atEnd } from '../lifetime.ts';
import type { Presentation } from '../stage/presentation.ts';
import { say, type Key, type Message } from '../words/text.ts';
import { Arc } from './teleport.ts';
import { Board } from './board.ts';
import { Glance } from './glance.ts';
import type { XrMode, XrPorts } from './ports.ts';
import { Reminder } from './reminder.ts';
import { APART, Rig } from './rig.ts';
import { Sight } from './sight.ts';
import { VoiceInSpace } from './sound.ts';
import { Stick } from './stick.ts';
import { Tools } from './tools.ts';

const TURN = Math.PI / 6; // rad, at once: smooth turns make people sick
const USUAL_RATE = 72; // pictures/s, of headsets that do not tell theirs
const HELD = 0.85; // of the headset's rate: what is less is seen
const RETURNING = 4; // the lower button of a controller (xr-standard)
const LEAVING = 5; // the upper one
const MOUTH = 0.07; // m under the eyes
const CHIN = 0.14;

/** A visit by headset, or through a phone: from its beginning until the visitor or the device ends it. */
export class Immersion implements Presentation {
  readonly session: XRSession;
  readonly rig: Rig;
  readonly camera: THREE.PerspectiveCamera;
  readonly passthrough: boolean;
  readonly ground: Presentation['ground'];
  readonly stands: boolean;
  readonly rate: number;
  readonly board: Board;
  readonly voice: VoiceInSpace | null;
  readonly tools = new Tools();
  private readonly ports: XrPorts;
  private readonly arc = new Arc();
  private readonly sticks = new Map<XRInputSource, Stick>();
  private readonly glance: Glance | null;
  private readonly ending = new AbortController();
  private readonly head = new THREE.Matrix4(); // of the visitor, in the headset's space
  private aim: { by: XRInputSource; at: THREE.Vector3 } | null = null; // m in the headset's space
  private met = false;
  private readonly followed = new Set<Key>(); // hints after which the visitor has talked
  private readonly reminder = new Reminder();
  private reminds = false; // of what was followed already
  private readonly sight = new Sight();

  /**
   * Asks the device for a session and shows the stage in it; needs a click right before.
   *
   * @throws PageError where the device or the visitor does not want it
   */
  static async begin(mode: XrMode, ports: XrPorts): Promise<void> {
    const { xr } = ports.stage.renderer;
    if (xr.isPresenting) return;
    const options = { requiredFeatures: ['local-floor'], optionalFeatures: ['hand-tracking', 'layers'] };
    const session = await navigator.xr!.requestSession(mode, options).catch((error: unknown) => {
      console.warn(error);
      throw new PageError(say('xr.refused'));
    });
    xr.enabled = true;
    xr.setReferenceSpaceType('local-floor');
    xr.setFramebufferScaleFactor(ports.settings.scale);
    xr.setFoveation(ports.settings.foveation);
    const ended = new AbortController();
    session.addEventListener('end', () => ended.abort());
    try {
      await xr.setSession(session);
    } catch (error) {
      console.warn(error);
      xr.enabled = false;
      await session.end().catch(() => {}); // it may have ended by itself
      throw new PageError(say('xr.impossible'));
    }
    const immersion = new Immersion(session, mode, ports);
    atEnd(ended.signal, () => immersion.leave());
  }

  private constructor(session: XRSession, mode: XrMode, ports: XrPorts) {
    const { stage, conversation, head, root } = ports;
    const meeting = stage.meeting!;
    this.session = session;
    this.ports = ports;
    this.passthrough = mode === 'immersive-ar';
    this.ground = meeting.ground;
    this.stands = meeting.stands;
    this.rate = HELD * (session.frameRate ?? USUAL_RATE);
    this.rig = new Rig(meeting.ground, meeting.eyes);
    this.camera = this.rig.camera;
    this.board = new Board(root);
    this.advise();
    this.voice = conversation ? new VoiceInSpace(conversation.player) : null;
    this.glance = head && !meeting.stands ? new Glance(meeting) : null;
    if (this.glance) head!.motion = () => this.glance!.motion();
    this.rig.add(this.tools, this.arc);
    stage.scene.add(this.rig, this.board);
    this.listen();
    stage.present(this);
  }

  /** Where the visitor is, and all that follows from it. */
  frame(step: number, pixels: number): void {
    const { xr } = this.ports.stage.renderer;
    const [frame, space] = [xr.getFrame(), xr.getReferenceSpace()];
    const pose = frame && space && frame.getViewerPose(space);
    if (!pose) return;
    for (const view of pose.views) view.requestViewportScale?.(pixels);
    this.head.fromArray(pose.transform.matrix);
    if (!this.met) this.meet();
    for (const source of this.session.inputSources) this.steer(source, frame, space);
    xr.updateCamera(this.camera);
    this.tools.heard = this.ports.conversation?.hearsButton ?? false;
    this.tools.update(frame, space);
    this.remind(step);
    this.attend(step);
  }

  /** Back to the page. */
  leave(): void {
    if (this.ending.signal.aborted) return;
    this.ending.abort();
    const { stage, head } = this.ports;
    this.hush();
    this.voice?.end();
    if (this.glance) head!.motion = null;
    stage.scene.remove(this.rig, this.board);
    for (const part of [this.board, this.tools, this.arc]) part.dispose();
    stage.renderer.xr.enabled = false;
    stage.present(null);
  }

  private listen(): void {
    const { signal } = this.ending;
    const { session, ports } = this;
    const end = () => void session.end().catch(() => {}); // it may have ended by itself
    const hear = (type: string, act: (event: XRInputSourceEvent) => void) => {
      session.addEventListener(type as 'select', act, { signal });
    };
    hear('selectstart', ({ inputSource }) => this.talk(inputSource));
    hear('selectend', ({ inputSource }) => this.silence(inputSource));
    session.addEventListener('inputsourceschange', ({ removed }) => {
      removed.forEach((source) => this.silence(source));
      this.advise(); // another tool is used in another way; headsets name them only after the visit has begun
    }, { signal });
    session.addEventListener('visibilitychange', () => session.visibilityState !== 'visible' && this.hush(), { signal });
    ports.stage.renderer.xr.getReferenceSpace()?.addEventListener('reset', () => (this.met = false), { signal });
    ports.stage.renderer.domElement.addEventListener('webglcontextlost', end, { signal });
    atEnd(ports.signal, () => {
      this.leave();
      end();
    });
  }

  private talk(source: XRInputSource): void {
    this.tools.talking.add(source);
    this.followed.add(this.hint().key);
    this.advise();
    void this.ports.conversation?.press();
  }

  private silence(source: XRInputSource): void {
    if (this.tools.talking.delete(source) && this.tools.talking.size === 0) this.ports.conversation?.release();
  }

  private hush(): void {
    for (const source of this.tools.talking) this.silence(source);
  }

  /** Stands before the visitor, wherever in their room they are and look to. */
  private meet(): void {
    this.met = true;
    const eye = this.eye();
    this.rig.meet(eye.clone().addScaledVector(this.ahead().setY(0).normalize(), APART), eye);
  }

  /** Does what a controller's stick and buttons ask for. */
  private steer(source: XRInputSource, frame: XRFrame, space: XRReferenceSpace): void {
    const { gamepad } = source;
    if (!gamepad || gamepad.mapping !== 'xr-standard') return;
    if (gamepad.buttons[RETURNING]?.pressed) this.met = false;
    if (gamepad.buttons[LEAVING]?.pressed) void this.session.end().catch(() => {});
    const [touchX = 0, touchY = 0, x = touchX, y = touchY] = gamepad.axes;
    if (!this.sticks.has(source)) this.sticks.set(source, new Stick());
    const wish = this.sticks.get(source)!.read(x, y);
    if (wish === 'aim') this.point(source, frame, space);
    if (wish === 'go' && this.aim?.by === source) this.go(this.aim.at);
    if (this.passthrough) return; // in a room of their own visitors turn themselves
    if (wish === 'left' || wish === 'right') this.turn(wish === 'left' ? TURN : -TURN);
  }

  private turn(angle: number): void {
    this.rig.turn(angle, this.eye());
    this.sight.carry();
  }

  private point(by: XRInputSource, frame: XRFrame, space: XRReferenceSpace): void {
    const ray = frame.getPose(by.targetRaySpace, space);
    if (!ray) return;
    const matrix = new THREE.Matrix4().fromArray(ray.transform.matrix);
    const direction = new THREE.Vector3(0, 0, -1).transformDirection(matrix);
    this.aim = { by, at: this.arc.show(new THREE.Vector3().setFromMatrixPosition(matrix), direction) };
  }

  /** The visitor goes somewhere; in a room of their own the avatar does. */
  private go(at: THREE.Vector3): void {
    if (this.passthrough) this.rig.meet(at, this.eye());
    else this.rig.go(this.rig.localToWorld(at.clone()), this.eye(), this.ahead());
    this.sight.carry();
    this.aim = null;
    this.arc.visible = false;
  }

  /** Captions, sound and look go with the visitor and with the face. */
  private attend(step: number): void {
    const head = this.head.clone().premultiply(this.rig.matrixWorld);
    const visitor = new THREE.Vector3().setFromMatrixPosition(head);
    this.glance?.look(visitor, step);
    this.sight.pass(step, this.rig.aside(this.eye(), this.ahead()));
    const { isLost } = this.sight;
    const { up } = this.ground;
    this.board.guide(isLost && this.canReturn() ? this.ports.words.text(say('xr.return')) : '');
    this.board.follow();
    this.board.place(visitor, isLost ? this.before(head) : this.sight.nearest(this.face(CHIN), visitor, up), up);
    this.voice?.place(this.face(MOUTH).applyMatrix4(head.invert()));
  }

  /** Where a chin would be of somebody who stands before a visitor with this head, m in the world. */
  private before(head: THREE.Matrix4): THREE.Vector3 {
    return new THREE.Vector3(0, 0, -APART).applyMatrix4(head).addScaledVector(this.ground.up, -CHIN);
  }

  private canReturn(): boolean {
    return [...this.session.inputSources].some(({ gamepad }) => gamepad?.mapping === 'xr-standard');
  }

  /** A place under the eyes of the avatar, m in the world. */
  private face(below: number): THREE.Vector3 {
    const { stage, head } = this.ports;
    const { eyes, local, ground } = stage.meeting!;
    if (!head || !local) return eyes.clone().addScaledVector(ground.up, -below);
    return head.generator.localToWorld(local.clone().setY(local.y - below));
  }

  /** Where the visitor's eyes are, m in the headset's space. */
  private eye(): THREE.Vector3 {
    return new THREE.Vector3().setFromMatrixPosition(this.head);
  }

  /** Where the visitor looks, in the headset's space. */
  private ahead(): THREE.Vector3 {
    return new THREE.Vector3(0, 0, -1).transformDirection(this.head);
  }

  /** After a quiet while the visitor is told again, above all how to leave. */
  private remind(step: number): void {
    const talks = this.tools.talking.size > 0 || !(this.ports.conversation?.isQuiet ?? true);
    const reminds = this.reminder.pass(step, talks);
    if (reminds === this.reminds) return;
    this.reminds = reminds;
    this.advise();
  }

  /** Tells how the present tools are used, until the visitor has talked by them. */
  private advise(): void {
    const { conversation, words } = this.ports;
    const hint = this.hint();
    this.board.advise(conversation && (this.reminds || !this.followed.has(hint.key)) ? words.text(hint) : '');
  }

  private hint(): Message {
    const sources = [...this.session.inputSources];
    if (sources.some(({ hand }) => hand)) return say('xr.hands');
    if (this.session.interactionMode === 'screen-space') return say('xr.screen');
    return say(this.passthrough ? 'xr.controllers-in-room' : 'xr.controllers');
  }
}
