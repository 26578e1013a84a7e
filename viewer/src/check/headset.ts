import { say } from '../words/text.ts';
import { good, none, type Finding } from './finding.ts';

/** Whether a headset can show the avatar. */
export async function checkHeadset(): Promise<Finding> {
  const { xr } = navigator as Navigator & { xr?: { isSessionSupported(mode: string): Promise<boolean> } };
  if (!xr) return none(say('check.headset.unknown'));
  const can = async (mode: string) => await xr.isSessionSupported(mode).catch(() => false);
  const [vr, ar] = await Promise.all([can('immersive-vr'), can('immersive-ar')]);
  if (!vr && !ar) return none(say('check.headset.none'));
  return good(say('check.headset.good', { modes: [vr && 'VR', ar && 'AR'].filter(Boolean).join(', ') }));
}
