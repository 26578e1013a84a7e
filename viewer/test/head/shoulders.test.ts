import { Matrix4, Quaternion, Vector3 } from 'three';
import { describe, expect, test } from 'vitest';
import { Shoulders, STILL } from '../../src/head/shoulders.ts';

const SIDE = new Vector3(1, 2, -1).normalize();

/** Row-major (4,4) of a turn about a slanted axis and a place. */
function place(angle: number, ...at: [number, number, number]): Matrix4 {
  return new Matrix4().compose(new Vector3(...at), new Quaternion().setFromAxisAngle(SIDE, angle), new Vector3(1, 1, 1));
}

function rowMajor(...poses: Matrix4[]): Float32Array {
  return Float32Array.from(poses.flatMap((pose) => pose.clone().transpose().elements));
}

describe('the shoulders of a head alone', () => {
  const poses = [place(0.2, 0.1, 0, 0), place(0.4, 0.1, 0.2, 0)];
  const shoulders = new Shoulders({ share: new Uint8Array(0), poses: rowMajor(...poses) });

  test.each([0, 0.5, 1])('stand in the world where row %f says, wherever the head is', (row) => {
    const head = place(2.9, -0.3, 0.1, 0.4);
    const position = new Vector3().setFromMatrixPosition(head);
    const [w, x, y, z, ...shift] = shoulders.motion(row, { position, quaternion: new Quaternion().setFromRotationMatrix(head) });
    expect(w).toBeGreaterThanOrEqual(0);
    const point = new Vector3(0.3, -0.2, 0.1);
    const bent = point.clone().applyQuaternion(new Quaternion(x, y, z, w)).add(new Vector3(...shift));
    const expected = point.applyMatrix4(place(0.2 + 0.2 * row, 0.1, 0.2 * row, 0));
    expect(bent.applyMatrix4(head).distanceTo(expected)).toBeLessThan(1e-6);
  });

  test('have not moved against a head that is where they are', () => {
    const quaternion = new Quaternion().setFromRotationMatrix(poses[0]!);
    const motion = shoulders.motion(0, { position: new Vector3(0.1, 0, 0), quaternion });
    for (const [i, value] of STILL.entries()) expect(motion[i]).toBeCloseTo(value, 6);
  });
});
