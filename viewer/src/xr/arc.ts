import * as THREE from 'three';

const SPEED = 5.5; // m/s at which what shows the way is thrown
const GRAVITY = 9.81; // m/s²
const PARTS = 24;
const COLOUR = 0xd9a77c;
const INNER = 0.16; // m, of the ring where it lands
const OUTER = 0.2;

/**
 * Where something thrown from a hand lands on the floor, y = 0, and the way there.
 *
 * @param from m
 * @param direction of length 1
 * @param share of the way, from 0 to 1
 */
export function thrown(from: THREE.Vector3, direction: THREE.Vector3, share = 1): THREE.Vector3 {
  const rise = SPEED * direction.y;
  const seconds = (share * (rise + Math.sqrt(rise * rise + 2 * GRAVITY * Math.max(0, from.y)))) / GRAVITY;
  const point = from.clone().addScaledVector(direction, SPEED * seconds);
  point.y -= 0.5 * GRAVITY * seconds * seconds;
  return point;
}

/** Shows in the headset's space where a stick that is let go leads. */
export class Arc extends THREE.Group {
  private readonly line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: COLOUR }));
  private readonly ring = new THREE.Mesh(new THREE.RingGeometry(INNER, OUTER, 48), new THREE.MeshBasicMaterial({ color: COLOUR }));

  constructor() {
    super();
    this.ring.rotateX(-Math.PI / 2);
    this.line.frustumCulled = this.visible = false;
    this.add(this.line, this.ring);
  }

  /** Shows the way from a hand; where it ends, m. */
  show(from: THREE.Vector3, direction: THREE.Vector3): THREE.Vector3 {
    const points = Array.from({ length: PARTS + 1 }, (_, i) => thrown(from, direction, i / PARTS));
    this.line.geometry.setFromPoints(points);
    this.ring.position.copy(points.at(-1)!);
    this.visible = true;
    return points.at(-1)!;
  }

  dispose(): void {
    for (const { geometry, material } of [this.line, this.ring]) {
      geometry.dispose();
      material.dispose();
    }
  }
}
