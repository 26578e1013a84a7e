import * as THREE from 'three';

const PLAIN = 0xb9bcc4;
const TALKING = 0xd9a77c;
const JOINTS = 25; // of a hand
const THIN = 0.008; // m, radius of a joint of which the headset tells none

/** A controller, or a hand, as it is shown. */
interface Shown {
  object: THREE.Mesh<THREE.BufferGeometry, THREE.MeshLambertMaterial>;
  joints: THREE.InstancedMesh | null; // of a hand; the object itself
}

/**
 * What the visitor holds, shown where it is: plain controllers, since models of each maker's would have
 * to be fetched from somewhere, or the hands' joints.
 */
export class Tools extends THREE.Group {
  /** Those by which the visitor talks now. */
  readonly talking = new Set<XRInputSource>();
  private readonly shown = new Map<XRInputSource, Shown>();
  private readonly handle = new THREE.CapsuleGeometry(0.017, 0.09, 4, 16).rotateX(Math.PI / 2); // along the way it points
  private readonly joint = new THREE.SphereGeometry(1, 12, 8);

  constructor() {
    super();
    this.add(new THREE.HemisphereLight(0xffffff, 0x50545c, 3));
  }

  /** Goes to where everything is in a frame. */
  update(frame: XRFrame, space: XRReferenceSpace): void {
    const sources = [...frame.session.inputSources].filter(({ targetRayMode }) => targetRayMode === 'tracked-pointer');
    for (const source of this.shown.keys()) if (!sources.includes(source)) this.drop(source);
    for (const source of sources) {
      const shown = this.shown.get(source) ?? this.take(source);
      shown.object.material.color.set(this.talking.has(source) ? TALKING : PLAIN);
      shown.object.visible = shown.joints ? showHand(shown.joints, source, frame, space) : hold(shown.object, source, frame, space);
    }
  }

  dispose(): void {
    for (const source of this.shown.keys()) this.drop(source);
    this.handle.dispose();
    this.joint.dispose();
  }

  private take(source: XRInputSource): Shown {
    const material = new THREE.MeshLambertMaterial();
    const joints = source.hand ? new THREE.InstancedMesh(this.joint, material, JOINTS) : null;
    const object = (joints ?? new THREE.Mesh(this.handle, material)) as Shown['object'];
    object.frustumCulled = object.matrixAutoUpdate = false;
    this.add(object);
    const shown = { object, joints };
    this.shown.set(source, shown);
    return shown;
  }

  private drop(source: XRInputSource): void {
    const { object, joints } = this.shown.get(source)!;
    object.removeFromParent();
    object.material.dispose();
    joints?.dispose();
    this.shown.delete(source);
  }
}

/** Puts a controller into the hand; false while it is not tracked. */
function hold({ matrix }: THREE.Object3D, { gripSpace }: XRInputSource, frame: XRFrame, space: XRReferenceSpace): boolean {
  const pose = gripSpace && frame.getPose(gripSpace, space);
  if (pose) matrix.fromArray(pose.transform.matrix);
  return pose != null;
}

/** Puts a ball at each joint of a hand; false while it is not tracked. */
function showHand(mesh: THREE.InstancedMesh, { hand }: XRInputSource, frame: XRFrame, space: XRReferenceSpace): boolean {
  const poses = [...hand!.values()].map((joint) => frame.getJointPose?.(joint, space));
  const matrix = new THREE.Matrix4();
  poses.slice(0, JOINTS).forEach((pose, i) => {
    if (!pose) return;
    const radius = pose.radius || THIN;
    mesh.setMatrixAt(i, matrix.fromArray(pose.transform.matrix).scale(new THREE.Vector3(radius, radius, radius)));
  });
  mesh.instanceMatrix.needsUpdate = true;
  return poses.every((pose) => pose != null);
}
