import { bad, fair, good, type Finding } from './finding.ts';

const TRIPS = 8;
const PATIENCE = 8000; // ms
const QUICK = 150; // ms, beyond which answers feel late
const APPLE = /iPhone|iPad|Version\/\S+ Safari/;

/** Whether browsers trust the way by which this page came. */
export function checkSecurity(): Finding {
  if (isSecureContext) return good('The page is trusted, so it may ask for microphone and headset.');
  return bad(
    'The page came by plain HTTP, so browsers give it neither microphone nor headset.',
    'Open it by https:// (its server needs `ico3d serve --tls`), or on the server’s own machine as localhost.',
  );
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
    return bad('No WebSocket reaches the server, so nobody can talk.', socketAdvice(url, navigator.userAgent));
  }
}

/** @param trips ms there and back, one or more */
export function judgeTrips(trips: readonly number[]): Finding {
  const middle = trips.toSorted((a, b) => a - b)[Math.floor(trips.length / 2)]!;
  const words = `The server answers within ${middle < 10 ? middle.toFixed(1) : Math.round(middle)} ms.`;
  if (middle <= QUICK) return good(words);
  return fair(words, 'Answers come that much later. A cable, a better place for wireless, or a server that is nearer would help.');
}

/** What may keep WebSockets from their server. */
export function socketAdvice(url: string, agent: string): string {
  const general = 'Is the server still running? A proxy or firewall on the way has to let WebSockets through.';
  if (!url.startsWith('wss:') || !APPLE.test(agent)) return general;
  return `${general} Safari opens none where you accepted a certificate by hand: the server needs one that this device trusts (\`--tls-cert\`).`;
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
