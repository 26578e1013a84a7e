/** Keys that move the camera, while the picture has the focus. */
export const TURNING = ['ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown'] as const;
export const ZOOMING = ['+', '-'] as const;
export const RETURNING = ['Home'] as const;

export type CameraKey = (typeof TURNING | typeof ZOOMING | typeof RETURNING)[number];
