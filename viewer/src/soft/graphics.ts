/** Who draws WebGL 2 in a browser. */
export interface Graphics {
  name: string; // as the browser calls it; some browsers hide it
  software: boolean; // the processor draws, in the place of a graphics card
}

const SOFTWARE = /swiftshader|llvmpipe|lavapipe|softpipe|swrast|software|basic render|gdi generic|mesa offscreen/i;

/**
 * Looks who draws WebGL 2; null where there is none.
 *
 * Where a browser hides the name, its own judgement counts: it refuses a context that must not be slow.
 * Nothing is measured: at this time the page loads, and a busy graphics card would pass for none.
 */
export function seeGraphics(): Graphics | null {
  const fast = open({ failIfMajorPerformanceCaveat: true });
  const gl = fast ?? open({});
  if (!gl) return null;
  const name = nameOf(gl);
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return { name, software: !fast || isSoftware(name) };
}

/** What the GPU calls itself; some browsers keep that behind an extension. */
export function nameOf(gl: WebGLRenderingContext | WebGL2RenderingContext): string {
  const unmasked = gl.getExtension('WEBGL_debug_renderer_info');
  return String(gl.getParameter(unmasked ? unmasked.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? '');
}

/** @param name how a browser calls who draws */
export function isSoftware(name: string): boolean {
  return SOFTWARE.test(name);
}

function open(settings: WebGLContextAttributes): WebGL2RenderingContext | null {
  return document.createElement('canvas').getContext('webgl2', settings);
}
