import { PageError } from '../../errors.ts';
import { say, type Key } from '../../words/text.ts';
import type { Sending } from './sending.ts';

const PIECE = 500; // ms of a part that are sent at once: what a closed page loses at most
const RATE = 5_000_000; // bits per second of the pictures
const SIDE = 512; // pixels of the short side of pictures for guidance
const JPEG = 0.8;
const KINDS = ['video/webm;codecs=vp8,opus', 'video/webm', 'video/mp4'];
const REASONS: Record<string, Key> = {
  NotAllowedError: 'studio.camera.blocked',
  NotFoundError: 'studio.camera.missing',
  NotReadableError: 'studio.camera.held',
};

/** The camera with its microphone, and what is recorded with them. */
export class Camera {
  private readonly view: HTMLVideoElement;
  private readonly canvas = document.createElement('canvas');
  private stream: MediaStream | null = null;
  private recorder: MediaRecorder | null = null;
  private stopped = Promise.resolve(); // the latest recording has handed over its last piece
  private readonly onLost: () => void;

  /** @param onLost the camera has ended by itself */
  constructor(view: HTMLVideoElement, onLost: () => void) {
    this.view = view;
    this.onLost = onLost;
  }

  get isOpen(): boolean {
    return this.stream !== null;
  }

  get isRecording(): boolean {
    return this.recorder !== null;
  }

  /**
   * Asks for camera and microphone, and shows what the camera sees.
   *
   * @throws PageError saying what the person can do about it
   */
  async open(): Promise<void> {
    if (this.stream) return;
    if (!isSecureContext) throw new PageError(say('studio.camera.untrusted'));
    const video = { width: { ideal: 1280 }, height: { ideal: 720 }, frameRate: { ideal: 30 }, facingMode: 'user' };
    const audio = { echoCancellation: false, noiseSuppression: false, autoGainControl: false };
    try {
      this.stream = await navigator.mediaDevices.getUserMedia({ video, audio });
    } catch (error) {
      throw new PageError(say(REASONS[(error as DOMException).name] ?? 'studio.camera.failed'));
    }
    for (const track of this.stream.getTracks()) track.onended = () => this.lose();
    this.view.srcObject = this.stream;
    await this.view.play().catch(() => {}); // it goes on by itself once it may
  }

  /** Turns the camera off; a recording ends with it. */
  close(): void {
    void this.stop();
    for (const track of this.stream?.getTracks() ?? []) track.stop();
    this.stream = this.view.srcObject = null;
  }

  /** Records until `stop`; each piece is sent at once. */
  record(sending: Sending, refused: (error: unknown) => void): void {
    if (!this.stream || this.recorder) return;
    const mimeType = KINDS.find((kind) => MediaRecorder.isTypeSupported(kind));
    this.recorder = new MediaRecorder(this.stream, { mimeType, videoBitsPerSecond: RATE });
    this.recorder.ondataavailable = ({ data }) => void sending.add(data).catch(refused);
    this.recorder.start(PIECE);
  }

  /** Ends the recording; the last piece has been handed over then. */
  stop(): Promise<void> {
    const recorder = this.recorder;
    this.recorder = null;
    if (recorder && recorder.state !== 'inactive') {
      this.stopped = new Promise((resolve) => recorder.addEventListener('stop', () => resolve(), { once: true }));
      recorder.stop();
    }
    return this.stopped;
  }

  /** What the camera sees now, as a small JPEG; null before the first picture. */
  picture(): Promise<Blob | null> {
    const { videoWidth: width, videoHeight: height } = this.view;
    if (!this.stream || width === 0) return Promise.resolve(null);
    const scale = Math.min(1, SIDE / Math.min(width, height));
    [this.canvas.width, this.canvas.height] = [Math.round(scale * width), Math.round(scale * height)];
    this.canvas.getContext('2d')!.drawImage(this.view, 0, 0, this.canvas.width, this.canvas.height);
    return new Promise((resolve) => this.canvas.toBlob(resolve, 'image/jpeg', JPEG));
  }

  private lose(): void {
    this.close();
    this.onLost();
  }
}
