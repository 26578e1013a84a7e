/** Functions of four numbers at once. */

const ROUNDER: f32 = 12582912.0; // 1.5 · 2²³: what is added to it is rounded, into the lowest bits

/** 2^x within 4e-6 for −126 < x < 127; anything else beyond. */
// @ts-ignore: decorator
@inline
export function powerOfTwo(x: v128): v128 {
  const rounder = f32x4.splat(ROUNDER);
  const shifted = f32x4.add(x, rounder);
  const part = f32x4.sub(x, f32x4.sub(shifted, rounder)); // from −½ to ½
  let power = f32x4.splat(0.0096181291);
  power = f32x4.add(f32x4.mul(power, part), f32x4.splat(0.0555041087));
  power = f32x4.add(f32x4.mul(power, part), f32x4.splat(0.2402265070));
  power = f32x4.add(f32x4.mul(power, part), f32x4.splat(0.6931471806));
  power = f32x4.add(f32x4.mul(power, part), f32x4.splat(1));
  return i32x4.add(power, i32x4.shl(shifted, 23));
}

/** 2^x, held at the smallest and largest powers. */
// @ts-ignore: decorator
@inline
export function heldPowerOfTwo(x: v128): v128 {
  return powerOfTwo(f32x4.max(f32x4.min(x, f32x4.splat(126)), f32x4.splat(-126)));
}

/** 1 / (1 + e^−x). */
// @ts-ignore: decorator
@inline
export function sigmoid(x: v128): v128 {
  const one = f32x4.splat(1);
  return f32x4.div(one, f32x4.add(one, heldPowerOfTwo(f32x4.mul(x, f32x4.splat(-1.4426950408889634)))));
}

/** Four numbers from 0 to 1 as the bytes of each lane's word. */
// @ts-ignore: decorator
@inline
export function bytesOf(red: v128, green: v128, blue: v128, alpha: v128): v128 {
  return v128.or(
    v128.or(byteOf(red), i32x4.shl(byteOf(green), 8)),
    v128.or(i32x4.shl(byteOf(blue), 16), i32x4.shl(byteOf(alpha), 24)),
  );
}

// @ts-ignore: decorator
@inline
function byteOf(value: v128): v128 {
  const scaled = f32x4.mul(f32x4.max(f32x4.min(value, f32x4.splat(1)), f32x4.splat(0)), f32x4.splat(255));
  return v128.and(f32x4.add(scaled, f32x4.splat(ROUNDER)), i32x4.splat(255));
}
