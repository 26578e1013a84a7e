import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { Refusal, type Recordings, type Status } from '../../../src/studio/recordings.ts';
import { Sending } from '../../../src/studio/room/sending.ts';
import studio from '../../../src/words/studio.json';
import { addTexts, codeOf } from '../../../src/words/text.ts';

/** A server that takes pieces, and answers as it is told. */
class Taking {
  readonly calls: string[] = [];
  readonly faults: Refusal[] = []; // of the next requests

  async append(name: string, part: string, _: string, offset: number, data: Blob): Promise<{ size: number }> {
    this.calls.push(`${name} ${part} ${offset} ${await data.text()}`);
    this.fail();
    return { size: offset + data.size };
  }

  async keep(): Promise<Status> {
    this.calls.push('keep');
    this.fail();
    return { name: 'Ida' } as Status;
  }

  private fail(): void {
    const fault = this.faults.shift();
    if (fault) throw fault;
  }
}

addTexts(studio);
const NO_ANSWER = new Refusal(0, '', '');
let server: Taking;
let lost: boolean[];
let sending: Sending;

beforeEach(() => {
  vi.useFakeTimers();
  [server, lost] = [new Taking(), []];
  sending = new Sending(server as unknown as Recordings, 'Ida', 'left', (now) => lost.push(now));
});
afterEach(() => void vi.useRealTimers());

test('pieces go in order, each behind those before', async () => {
  void sending.add(new Blob(['how a video begins']));
  void sending.add(new Blob(['']));
  void sending.add(new Blob(['three']));
  expect(await sending.keep()).toEqual({ name: 'Ida' });
  expect(server.calls).toEqual(['Ida left 0 how a video begins', 'Ida left 18 three', 'keep']);
  expect(lost).toEqual([]);
});

test('a beginning too short to be known as a video goes together with what follows', async () => {
  void sending.add(new Blob(['h']));
  void sending.add(new Blob(['ow']));
  await sending.add(new Blob([' a video begins']));
  await sending.add(new Blob(['.']));
  expect(server.calls).toEqual(['Ida left 0 how a video begins', 'Ida left 18 .']);
});

test('what stays too short is sent at the end, and the server says what it is', async () => {
  void sending.add(new Blob(['one']));
  await sending.keep();
  expect(server.calls).toEqual(['Ida left 0 one', 'keep']);
});

test('a server that does not answer gets the same piece again until it does', async () => {
  server.faults.push(NO_ANSWER, NO_ANSWER);
  void sending.add(new Blob(['how a video begins']));
  const kept = sending.keep();
  await vi.advanceTimersByTimeAsync(2500);
  await kept;
  expect(server.calls).toEqual(['Ida left 0 how a video begins', 'Ida left 0 how a video begins', 'Ida left 0 how a video begins', 'keep']);
  expect(lost).toEqual([true, false]);
});

test('a piece that is refused ends it, and what follows is not sent', async () => {
  server.faults.push(new Refusal(507, 'full', 'the disk is full.'));
  await expect(sending.add(new Blob(['how a video begins']))).rejects.toThrow(/^The disk is full/);
  await expect(sending.add(new Blob(['two']))).rejects.toThrow(Refusal);
  await expect(sending.keep()).rejects.toThrow(Refusal);
  expect(server.calls).toEqual(['Ida left 0 how a video begins']);
});

test('a refusal is said in the words of the page, where it has some', () => {
  expect(codeOf(new Refusal(507, 'full', 'x').sentence)).toBe('studio.refused.full');
  expect(codeOf(NO_ANSWER.sentence)).toBe('studio.lost');
  expect(new Refusal(500, '', 'all is gone but x.').message).toBe('all is gone but x.');
});

test('a video goes slice by slice, and is told how much of it has gone', async () => {
  const sizes: [number, number][] = [];
  server.append = async (_name, _part, _take, offset, { size }) => {
    sizes.push([offset, size]);
    return { size: offset + size };
  };
  const told: number[] = [];
  const [slice, size] = [4 << 20, 9 << 20];
  await sending.addVideo(new Blob([new Uint8Array(size)]), (percent) => told.push(percent));
  expect(sizes).toEqual([[0, slice], [slice, slice], [2 * slice, size - 2 * slice]]);
  expect(told).toEqual([0, 44, 88]);
});
