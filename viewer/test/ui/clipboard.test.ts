import { expect, test } from 'vitest';
import { plain } from '../../src/ui/sheets/clipboard.ts';

test('a saved talk has nothing that a terminal obeys', () => {
  expect(plain('Iris\u001b]0;owned\u0007, today\n\n[10:00] You: \u009b2JGrüße\r\n')).toBe('Iris]0;owned, today\n\n[10:00] You: 2JGrüße\n');
});
