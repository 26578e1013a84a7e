import { parseCalmly } from '../words/calm.ts';
import { floatsFromHalves } from '../numbers.ts';
import { MAX_BINARY_FRAME, MAX_TEXT_FRAME, TENSORS, VERSION, type ClientMessage, type Matrix, type ServerMessage } from '../protocol.ts';
import { SERVER_FIELDS } from './line/fields.ts';
import { fits } from './line/shape.ts';

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
  if (typeof frame === 'string') return checked(parse(frame), false);
  if (frame.byteLength > MAX_BINARY_FRAME) throw new Error(`a message of more than ${MAX_BINARY_FRAME} bytes`);
  const length = new DataView(frame).getUint32(0, true);
  const header = parse(new TextDecoder().decode(new Uint8Array(frame, 4, length)));
  const message = checked(header, true);
  let at = 4 + length;
  for (const [field, kind] of TENSORS[header.type] ?? []) {
    const shape = header[field];
    if (!isShape(shape, kind === 'int16' ? 1 : 2)) throw new Error(`${header.type}: ${field} has an odd shape`);
    const end = at + 2 * shape.reduce((product, size) => product * size, 1);
    const words = new Uint16Array(frame.slice(at, end));
    header[field] = kind === 'int16' ? new Int16Array(words.buffer) : matrix(shape, words);
    at = end;
  }
  if (at !== frame.byteLength) throw new Error(`${header.type}: ${frame.byteLength} bytes instead of ${at}`);
  return message;
}

function parse(text: string): Header {
  if (text.length > MAX_TEXT_FRAME) throw new Error(`a text of more than ${MAX_TEXT_FRAME} bytes`);
  return parseCalmly(text) as Header;
}

/** Whether sizes are some of an array; a frame's bytes bound each, also where another one is 0 and nothing was sent. */
function isShape(sizes: unknown, axes: number): sizes is number[] {
  return Array.isArray(sizes) && sizes.length === axes && sizes.every((size) => Number.isInteger(size) && size >= 0 && size <= MAX_BINARY_FRAME);
}

/** What has no arrays travels as text: of that, less may come than of sound. A welcome of another version may consist of anything. */
function checked(header: Header, binary: boolean): ServerMessage {
  const fields = Object.hasOwn(SERVER_FIELDS, header.type) ? SERVER_FIELDS[header.type] : undefined;
  if (!fields) throw new Error(`unknown message ${header.type}`);
  if (Object.hasOwn(TENSORS, header.type) !== binary) throw new Error(`${header.type} is no message of a ${binary ? 'binary' : 'text'} frame`);
  const foreign = header.type === 'welcome' && header.version !== VERSION;
  if (!foreign && !fits(header, { fields })) throw new Error(`${header.type} does not consist of what it must`);
  return header as unknown as ServerMessage;
}

/** More than a frame has room for the sound of. */
const MOST_ROWS = 64;

/** Rows that hold nothing are none: nobody sent them, and each would take up memory. */
function matrix(shape: number[], words: Uint16Array): Matrix {
  const [rows = 0, columns = 0] = shape;
  if (columns && rows > MOST_ROWS) throw new Error(`expressions of ${rows} moments are more than a piece has`);
  return { rows: columns && rows, columns, values: floatsFromHalves(words) };
}
