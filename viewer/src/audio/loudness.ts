/** How loud somebody is: a volume from 0 to 1, and whether they are muted, which leaves the volume as it is. */
export class Loudness {
  private readonly apply: (gain: number) => void;
  private wanted = 1;
  private silent = false;

  /** @param apply takes the gain that follows, from 0 to 1 */
  constructor(apply: (gain: number) => void) {
    this.apply = apply;
  }

  set volume(volume: number) {
    this.wanted = Math.min(1, Math.max(0, volume));
    this.settle();
  }

  get muted(): boolean {
    return this.silent;
  }

  set muted(muted: boolean) {
    this.silent = muted;
    this.settle();
  }

  private settle(): void {
    this.apply(this.silent ? 0 : this.wanted);
  }
}
