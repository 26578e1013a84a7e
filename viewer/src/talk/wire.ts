import { floatFromHalf } from '../half.ts';
import { SERVER_TYPES, TENSORS, type ClientMessage, type Matrix, type ServerMessage } from '../protocol.ts';

/** What is done with each of some messages: the compiler misses none. */
export type Handlers<M extends ServerMessage> = {
  [Type in M['type']]: (message: Extract<M, { type: Type }>) => void;
};

/** Does what there is to be done with a message. */
export function handle<M extends ServerMessage>(message: M, handlers: Handlers<M>): void {
  (handlers[message.type as M['type']] as (message: M) => void)(message);
}

type Header = { type: string } & Record<string, unknown>;

/** A message as a WebSocket frame. */
export function encode(message: ClientMessage): string | ArrayBuffer {
  const header: Header = { ...message };
  const tensors = TENSORS[message.type];
  if (!tensors) return JSON.stringify(header);
  const parts: Int16Array[] = [];
  for (const [field] of tensors) {
    const values = header[field] as Int16Array;
    parts.push(values);
    header[field] = [values.length];
  }
  return joinFrame(new TextEncoder().encode(JSON.stringify(header)), parts);
}

function joinFrame(header: Uint8Array, parts: Int16Array[]): ArrayBuffer {
  const length = parts.reduce((sum, part) => sum + part.byteLength, 4 + header.byteLength);
  const frame = new Uint8Array(length);
  new DataView(frame.buffer).setUint32(0, header.byteLength, true);
  frame.set(header, 4);
  let at = 4 + header.byteLength;
  for (const part of parts) {
    frame.set(new Uint8Array(part.buffer, part.byteOffset, part.byteLength), at);
    at += part.byteLength;
  }
  return frame.buffer;
}

/** A frame as a message; throws an Error on one that is not from this protocol. */
export function decode(frame: string | ArrayBuffer): ServerMessage {
  if (typeof frame === 'string') return known(JSON.parse(frame) as Header);
  const length = new DataView(frame).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(frame, 4, length))) as Header;
  let at = 4 + length;
  for (const [field, kind] of TENSORS[header.type] ?? []) {
    const shape = header[field] as number[];
    const bytes = 2 * shape.reduce((product, size) => product * size, 1);
    const words = new Uint16Array(frame.slice(at, at + bytes));
    header[field] = kind === 'int16' ? new Int16Array(words.buffer) : matrix(shape, words);
    at += bytes;
  }
  return known(header);
}

function known(header: Header): ServerMessage {
  if (!SERVER_TYPES.includes(header.type)) throw new Error(`unknown message ${header.type}`);
  return header as unknown as ServerMessage;
}

function matrix(shape: number[], words: Uint16Array): Matrix {
  const [rows = 0, columns = 0] = shape;
  return { rows, columns, values: Float32Array.from(words, floatFromHalf) };
}
