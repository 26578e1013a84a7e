import { say, type Message } from '../words/text.ts';
import { bad, fair, good, type Finding } from './finding.ts';

const TRIPS = 8;
const PATIENCE = 8000; // ms
const QUICK = 150; // ms, beyond which answers feel late
const APPLE = /iPhone|iPad|Version\/\S+ Safari/;

/** Whether browsers trust the way by which this page came. */
export function checkSecurity(): Finding {
  if (isSecureContext) return good(say('check.secure.good'));
  return bad(say('check.secure.bad'), say('check.secure.advice'));
}

/**
 * Whether a WebSocket reaches the server, and how long there and back takes.
 *
 * @param url of a socket that returns what it gets
 */
export async function checkSocket(url: string): Promise<Finding> {
  try {
    return judgeTrips(await roundTrips(url));
  } catch {
    return bad(say('check.socket.bad'), socketAdvice(url, navigator.userAgent));
  }
}

/** @param trips ms there and back, one or more */
export function judgeTrips(trips: readonly number[]): Finding {
  const middle = trips.toSorted((a, b) => a - b)[Math.floor(trips.length / 2)]!;
  const words = say('check.socket.good', { n: middle < 10 ? Math.round(10 * middle) / 10 : Math.round(middle) });
  if (middle <= QUICK) return good(words);
  return fair(words, say('check.socket.slow'));
}

/** What may keep WebSockets from their server. */
export function socketAdvice(url: string, agent: string): Message {
  return say(url.startsWith('wss:') && APPLE.test(agent) ? 'check.socket.safari' : 'check.socket.advice');
}

function roundTrips(url: string): Promise<number[]> {
  return new Promise((resolve, reject) => {
    const socket = new WebSocket(url);
    const trips: number[] = [];
    const late = setTimeout(() => socket.close(), PATIENCE);
    const send = () => socket.send(String(performance.now()));
    socket.onopen = send;
    socket.onmessage = ({ data }: MessageEvent<string>) => {
      trips.push(performance.now() - Number(data));
      if (trips.length < TRIPS) send();
      else socket.close();
    };
    socket.onclose = () => {
      clearTimeout(late);
      if (trips.length > 0) resolve(trips);
      else reject(new Error('no answer'));
    };
  });
}
