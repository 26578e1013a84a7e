import { good, none, type Finding } from './finding.ts';

/** Whether a headset can show the avatar. */
export async function checkHeadset(): Promise<Finding> {
  const { xr } = navigator as Navigator & { xr?: { isSessionSupported(mode: string): Promise<boolean> } };
  if (!xr) return none('This browser knows no headsets (WebXR); all else works without.');
  const can = async (mode: string) => await xr.isSessionSupported(mode).catch(() => false);
  const [vr, ar] = await Promise.all([can('immersive-vr'), can('immersive-ar')]);
  if (!vr && !ar) return none('No headset is connected; all else works without.');
  return good(`Headset ready: ${[vr && 'VR', ar && 'AR'].filter(Boolean).join(' and ')}.`);
}
