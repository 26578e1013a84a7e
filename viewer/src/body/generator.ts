import { Generator } from '../gaussians/generator.ts';
import type { SoftObject } from '../soft/source.ts';
import { coefficientPlaces, coefficientTexels, type Capacity, type PackedWindow } from './packed.ts';
import { SoftSlot } from './soft.ts';
import { coefficientsAt } from './window.ts';

/**
 * One slot as a generator: it moves the Gaussians of the window in the slot.
 *
 * The slot's capacity never changes. A window that will be seen soon is awake: it takes part in
 * sorting, so that it can appear from one picture to the next. Other windows are asleep and cost next
 * to nothing.
 */
export class WindowGenerator extends Generator {
  readonly capacity: Capacity;
  /** The window in the slot. */
  content: PackedWindow | null = null;
  /** Coefficients of the moment in the capacity's layout, one row per cluster. */
  readonly coefficients: Float32Array;
  readonly soft: SoftObject;
  private active = false;
  private visibleNow = false;
  private readonly found: Float32Array; // coefficients of the window at the posed time
  private places: number[] = []; // where each of the window's coefficients is in the layout

  constructor(capacity: Capacity) {
    super(capacity.count);
    this.capacity = capacity;
    this.coefficients = new Float32Array(4 * coefficientTexels(capacity.ranks) * capacity.clusters);
    this.found = new Float32Array(this.coefficients.length);
    this.soft = new SoftSlot(this);
  }

  /** Whether the window takes part in sorting. */
  get awake(): boolean {
    return this.active;
  }

  override get unseen(): boolean {
    return this.active && !this.visibleNow;
  }

  /** Number of its Gaussians that take part in pictures. */
  get count(): number {
    return this.active ? this.content!.window.num_gaussians : 0;
  }

  /** Puts a window into the slot, asleep. */
  hold(content: PackedWindow): void {
    this.content = content;
    this.places = coefficientPlaces(content.window, this.capacity);
    this.active = false;
    this.coefficients.fill(0);
    this.changed();
  }

  /**
   * Poses the window in the slot, if there is one, at τ in [0, 1], and wakes it.
   *
   * @param visible whether it is seen
   * @returns whether anything changed
   */
  pose(tau: number, visible: boolean): boolean {
    if (!this.content) return false;
    const { coefficients } = this;
    coefficientsAt(this.content.curve, tau, this.found);
    let changed = visible !== this.visibleNow || !this.active;
    this.active = true;
    this.visibleNow = visible;
    this.places.forEach((place, k) => {
      if (coefficients[place] !== this.found[k]) changed = true;
      coefficients[place] = this.found[k]!;
    });
    if (changed) this.changed();
    return changed;
  }

  /**
   * Takes the window out of pictures and sorting.
   *
   * @returns whether anything changed
   */
  sleep(): boolean {
    if (!this.active) return false;
    this.active = false;
    this.changed();
    return true;
  }
}
