import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import type { AxeResults } from 'axe-core';
import type { Page } from 'playwright-core';
import { expect } from 'vitest';

const AXE = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
const DESKTOP = { width: 1280, height: 720 };
const PHONE = { width: 360, height: 640 };

/** What axe finds that keeps somebody out. */
async function findings(page: Page, rules?: string[]): Promise<string[]> {
  if (!(await page.evaluate(() => 'axe' in window))) await page.evaluate(AXE);
  const { violations } = (await page.evaluate((rules) => {
    const { axe } = window as unknown as { axe: typeof import('axe-core') };
    const asked: import('axe-core').RunOptions = rules ? { runOnly: rules } : { rules: { 'target-size': { enabled: true } } };
    return axe.run(document, { ...asked, resultTypes: ['violations'] });
  }, rules)) as AxeResults;
  return violations
    .filter(({ impact }) => impact === 'serious' || impact === 'critical')
    .flatMap(({ id, nodes }) => nodes.map(({ target, failureSummary }) => `${id}: ${target.join(' ')} ${failureSummary}`));
}

/**
 * Looks at a state on a desktop in the dark and on a phone in the light, and at the colours of the other two.
 *
 * Pictures of them go into the folder `$PICTURES`, where it is set.
 */
export async function judge(page: Page, state: string): Promise<void> {
  for (const [size, colorScheme, rules] of [
    [DESKTOP, 'dark', undefined],
    [DESKTOP, 'light', ['color-contrast']],
    [PHONE, 'dark', ['color-contrast']],
    [PHONE, 'light', undefined],
  ] as const) {
    await page.setViewportSize(size);
    await page.emulateMedia({ colorScheme, reducedMotion: 'reduce' });
    await page.evaluate((theme) => document.body.dataset.theme && (document.body.dataset.theme = theme), colorScheme); // it may not listen yet
    if (process.env.PICTURES) await page.screenshot({ path: join(process.env.PICTURES, `${state}-${size.width}-${colorScheme}.png`) });
    const found = await findings(page, rules && [...rules]);
    expect.soft(found, `${state}, ${size.width} px, ${colorScheme}`).toEqual([]);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    expect.soft(wide, state).toBeLessThanOrEqual(0);
  }
}
