/** Line icons on a 24-unit grid. */
const PATHS = {
  microphone: 'M12 3a3 3 0 0 0-3 3v6a3 3 0 0 0 6 0V6a3 3 0 0 0-3-3ZM5.5 11.5a6.5 6.5 0 0 0 13 0M12 18v3',
  blocked: 'M12 3a3 3 0 0 0-3 3v6a3 3 0 0 0 6 0V6a3 3 0 0 0-3-3ZM5.5 11.5a6.5 6.5 0 0 0 13 0M12 18v3M4 3.5l16 17',
  sound: 'M4.5 9.5v5h3.2l4.3 3.8V5.7L7.7 9.5ZM15.2 9.2a4 4 0 0 1 0 5.6M17.8 6.6a7.6 7.6 0 0 1 0 10.8',
  muted: 'M4.5 9.5v5h3.2l4.3 3.8V5.7L7.7 9.5ZM15.5 9.7l4.6 4.6M20.1 9.7l-4.6 4.6',
  talk: 'M4.5 5.5h15v10H11l-4 4v-4H4.5z',
  radio: 'M6.5 8.5h8.6A1.9 1.9 0 0 1 17 10.4v8.7a1.9 1.9 0 0 1-1.9 1.9H8.4a1.9 1.9 0 0 1-1.9-1.9V2.8M13.6 8.5V5.6M10 12.6h3.5M10 16.4h3.5', // on such a one a button is held while one speaks
  close: 'M6.5 6.5l11 11M17.5 6.5l-11 11',
  send: 'M12 19V5M6 11l6-6 6 6',
  stop: 'M7 7h10v10H7z',
  chart: 'M5 19v-6M12 19V5M19 19v-9',
  record: 'M5 5h14M5 10h14M5 15h9M5 20h6',
  sliders: 'M4 8h9M17 8h3M4 16h3M11 16h9M15 5.5v5M9 13.5v5',
  play: 'M8 5.5v13l10.5-6.5z',
  pause: 'M8.5 6v12M15.5 6v12',
  sun: 'M12 8a4 4 0 1 0 0 8a4 4 0 0 0 0-8ZM12 2.8v2M12 19.2v2M2.8 12h2M19.2 12h2M5.5 5.5l1.4 1.4M17.1 17.1l1.4 1.4M5.5 18.5l1.4-1.4M17.1 6.9l1.4-1.4',
  moon: 'M19.5 14.2A8 8 0 0 1 9.8 4.5a8 8 0 1 0 9.7 9.7Z',
  face: 'M12 4a6 6.8 0 0 0-6 6.8c0 4.6 2.9 8.2 6 8.2s6-3.6 6-8.2A6 6.8 0 0 0 12 4ZM9.7 10.3v.8M14.3 10.3v.8M9.8 14.6c1.2 1 3.2 1 4.4 0',
  half: 'M12 4.5a3.4 3.4 0 1 0 0 6.8a3.4 3.4 0 0 0 0-6.8ZM4.5 19.8c.3-4.2 3.4-6.2 7.5-6.2s7.2 2 7.5 6.2',
  headset: 'M4 8h16a1.5 1.5 0 0 1 1.5 1.5v6A1.5 1.5 0 0 1 20 17h-4.2l-2.3-2.6a2 2 0 0 0-3 0L8.2 17H4a1.5 1.5 0 0 1-1.5-1.5v-6A1.5 1.5 0 0 1 4 8Z',
  room: 'M12 3l8 4.5v9L12 21l-8-4.5v-9zM4 7.5l8 4.5l8-4.5M12 12v9',
  whole: 'M12 2.8a2.1 2.1 0 1 0 0 4.2a2.1 2.1 0 0 0 0-4.2ZM7.5 14c0-3.2 1.6-4.6 4.5-4.6s4.5 1.4 4.5 4.6M10.2 21.2v-6.6M13.8 21.2v-6.6',
} as const;

/** An icon for a button that has its own label. */
export function icon(name: keyof typeof PATHS): SVGSVGElement {
  const space = 'http://www.w3.org/2000/svg';
  const svg = document.createElementNS(space, 'svg');
  svg.setAttribute('viewBox', '0 0 24 24');
  svg.setAttribute('aria-hidden', 'true');
  const path = document.createElementNS(space, 'path');
  path.setAttribute('d', PATHS[name]);
  svg.append(path);
  return svg;
}
