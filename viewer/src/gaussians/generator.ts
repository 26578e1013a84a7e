import { Object3D } from 'three';

/** Gaussians on stage that change: it holds what makes them those of the moment, for whatever draws them. */
export abstract class Generator extends Object3D {
  /** Another number whenever they look otherwise. */
  version = 0;
  readonly numSplats: number;

  /** @param numSplats all Gaussians that there may be */
  constructor(numSplats: number) {
    super();
    this.numSplats = numSplats;
  }

  /** Whether they are only made ready, and must not be seen yet. */
  get unseen(): boolean {
    return false;
  }

  protected changed(): void {
    this.version++;
  }
}
