import * as THREE from 'three';

const PLAIN = 0xb9bcc4;
const TALKING = 0xd9a77c;
const JOINTS = 25; // of a hand
const THIN = 0.008; // m, radius of a joint of which the headset tells none
const HANDLE = [0.018, 0.018, 0.07] as const; // m, radii of a controller, which is long where it points to

/** A controller, or a hand, as it is shown. */
interface Shown {
  object: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  joints: THREE.InstancedMesh | null; // of a hand; the object itself
}

/**
 * What the visitor holds, shown where it is: plain controllers, since models of each maker's would have
 * to be fetched from somewhere, or the hands' joints.
 */
export class Tools extends THREE.Group {
  /** Those by which the visitor wants to talk now. */
  readonly talking = new Set<XRInputSource>();
  /** Whether they are heard: only then it is shown. */
  heard = false;
  private readonly shown = new Map<XRInputSource, Shown>();
  private readonly ball = new THREE.SphereGeometry(1, 20, 12);
  private readonly handle = this.ball.clone().scale(...HANDLE);

  /** Goes to where everything is in a frame. */
  update(frame: XRFrame, space: XRReferenceSpace): void {
    const sources = [...frame.session.inputSources].filter(({ targetRayMode }) => targetRayMode === 'tracked-pointer');
    for (const source of this.shown.keys()) if (!sources.includes(source)) this.drop(source);
    for (const source of sources) {
      const shown = this.shown.get(source) ?? this.take(source);
      (shown.object.material.uniforms.colour!.value as THREE.Color).setHex(this.heard && this.talking.has(source) ? TALKING : PLAIN, THREE.LinearSRGBColorSpace); // as it is displayed
      shown.object.visible = shown.joints ? showHand(shown.joints, source, frame, space) : hold(shown.object, source, frame, space);
    }
  }

  dispose(): void {
    for (const source of this.shown.keys()) this.drop(source);
    this.handle.dispose();
    this.ball.dispose();
  }

  private take(source: XRInputSource): Shown {
    const uniforms = { colour: { value: new THREE.Color() } };
    const material = new THREE.ShaderMaterial({ vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms });
    const joints = source.hand ? new THREE.InstancedMesh(this.ball, material, JOINTS) : null;
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

// Lit from above where the visitor looks: nothing else on stage needs lamps.
const VERTEX = `
  varying vec3 facing;
  void main() {
    #ifdef USE_INSTANCING
      mat4 place = modelViewMatrix * instanceMatrix;
    #else
      mat4 place = modelViewMatrix;
    #endif
    facing = mat3(place) * normal;
    gl_Position = projectionMatrix * place * vec4(position, 1.0);
  }
`;
const FRAGMENT = `
  uniform vec3 colour;
  varying vec3 facing;
  void main() {
    float light = max(0.0, dot(normalize(facing), vec3(0.0, 0.8, 0.6)));
    gl_FragColor = vec4(colour * (0.45 + 0.55 * light), 1.0);
  }
`;
