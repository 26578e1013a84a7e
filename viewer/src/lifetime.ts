/** Calls a function when a signal is aborted, at once if it is already. */
export function atEnd(signal: AbortSignal, act: () => void): void {
  if (signal.aborted) act();
  else signal.addEventListener('abort', act, { once: true });
}

/** Calls a function every so many milliseconds until a signal is aborted. */
export function every(milliseconds: number, signal: AbortSignal, act: () => void): void {
  const timer = setInterval(act, milliseconds);
  atEnd(signal, () => clearInterval(timer));
}
