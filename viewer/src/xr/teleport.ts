import * as THREE from 'three';

const SPEED = 3.5; // m/s at which what shows the way is thrown: from a level hand it lands within sight
const GRAVITY = 9.81; // m/s²
const DOTS = 24;
const DOT = 0.012; // m, radius
const MARK = 0.2; // m, radius of the mark where it lands
const FLAT = 0.01; // of the mark's radius: its height
const COLOUR = 0xd9a77c;

/**
 * Where something thrown from a hand lands on the floor, y = 0, and the way there.
 *
 * @param from m
 * @param direction of length 1
 * @param share of the way's time, from 0 to 1
 */
export function thrown(from: THREE.Vector3, direction: THREE.Vector3, share = 1): THREE.Vector3 {
  const rise = SPEED * direction.y;
  const seconds = (share * (rise + Math.sqrt(rise * rise + 2 * GRAVITY * Math.max(0, from.y)))) / GRAVITY;
  const point = from.clone().addScaledVector(direction, SPEED * seconds);
  point.y -= 0.5 * GRAVITY * seconds * seconds;
  return point;
}

/** Shows in the headset's space where a stick that is let go leads. */
export class Arc extends THREE.InstancedMesh<THREE.SphereGeometry, THREE.MeshBasicMaterial> {
  constructor() {
    super(new THREE.SphereGeometry(1, 16, 8), new THREE.MeshBasicMaterial({ color: COLOUR }), DOTS + 1);
    this.frustumCulled = this.visible = false;
  }

  /** Shows the way from a hand; where it ends, m. */
  show(from: THREE.Vector3, direction: THREE.Vector3): THREE.Vector3 {
    const matrix = new THREE.Matrix4();
    for (let i = 0; i < DOTS; i++) {
      this.setMatrixAt(i, matrix.makeScale(DOT, DOT, DOT).setPosition(thrown(from, direction, i / DOTS)));
    }
    const end = thrown(from, direction);
    this.setMatrixAt(DOTS, matrix.makeScale(MARK, FLAT * MARK, MARK).setPosition(end));
    this.instanceMatrix.needsUpdate = true;
    this.visible = true;
    return end;
  }

  override dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
    super.dispose();
  }
}
