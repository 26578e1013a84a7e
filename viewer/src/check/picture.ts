import type { Graphics } from '../soft/graphics.ts';
import { say } from '../words/text.ts';
import { bad, fair, good, none, type Finding } from './finding.ts';

const ACCELERATE = say('check.graphics.advice');
const SPRITES = 20_000; // about as much to draw as the first sight of an avatar
const SIDE = 480; // pixels
const DURATION = 1500; // ms
const PATIENCE = 10_000; // ms: pages in the background draw nothing
const SMOOTH = 30; // frames per second
const BEARABLE = 12;

const VERTEX = `#version 300 es
uniform float time;
out vec2 at;
void main() {
  at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  float turn = float(gl_InstanceID) * 2.399963 + time;
  float far = sqrt(float(gl_InstanceID) / ${SPRITES}.0);
  gl_Position = vec4(0.9 * far * vec2(cos(turn), sin(turn)) + 0.02 * at, 0.0, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision mediump float;
in vec2 at;
out vec4 colour;
void main() {
  float alpha = 0.3 * exp(-4.0 * dot(at, at));
  colour = vec4(0.9, 0.7, 0.5, 1.0) * alpha;
}`;

/** @param graphics who draws WebGL 2; null where there is none */
export function judgeGraphics(graphics: Graphics | null): Finding {
  if (!graphics) return fair(say('check.graphics.none'), ACCELERATE);
  const { name, software } = graphics;
  return software ? fair(say('check.graphics.software', { name }), ACCELERATE) : good(say('check.graphics.good', { name }));
}

/** Draws soft sprites for a moment and counts, where WebGL draws avatars. */
export async function checkFrames(graphics: Graphics | null): Promise<Finding> {
  if (!graphics || graphics.software) return none(say('check.frames.none'));
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = SIDE;
  const gl = canvas.getContext('webgl2', { antialias: false });
  if (!gl) return none(say('check.frames.none'));
  try {
    const rate = await countFrames(gl);
    return rate === null
      ? fair(say('check.frames.hidden'), say('check.frames.front'))
      : judgeRate(rate);
  } finally {
    gl.getExtension('WEBGL_lose_context')?.loseContext();
  }
}

/** @param rate frames per second of the small scene */
export function judgeRate(rate: number): Finding {
  const words = say('check.frames.rate', { n: Math.round(rate) });
  if (rate >= SMOOTH) return good(words);
  const advice = say('check.frames.advice');
  return rate >= BEARABLE ? fair(words, advice) : bad(words, advice);
}

/** Frames per second; null if the browser draws none. */
function countFrames(gl: WebGL2RenderingContext): Promise<number | null> {
  const program = link(gl);
  const time = gl.getUniformLocation(program, 'time');
  const pixel = new Uint8Array(4);
  gl.useProgram(program);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  return new Promise((resolve) => {
    const late = setTimeout(() => resolve(null), PATIENCE);
    let [began, frames] = [0, -1]; // the first one compiles the shader
    const draw = (now: number) => {
      gl.clear(gl.COLOR_BUFFER_BIT);
      gl.uniform1f(time, now / 1000);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, SPRITES);
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); // waits until it is drawn
      if (++frames === 0) began = now;
      if (frames === 0 || now - began < DURATION) return void requestAnimationFrame(draw);
      clearTimeout(late);
      resolve((1000 * frames) / (now - began));
    };
    requestAnimationFrame(draw);
  });
}

function link(gl: WebGL2RenderingContext): WebGLProgram {
  const program = gl.createProgram();
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, VERTEX],
    [gl.FRAGMENT_SHADER, FRAGMENT],
  ] as const) {
    const shader = gl.createShader(kind)!;
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return program;
}
