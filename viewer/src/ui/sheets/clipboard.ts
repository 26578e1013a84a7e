/**
 * Copies a text; returns whether the browser let it.
 *
 * @param place where a text may be selected, since pages that are not trusted have no clipboard
 */
export async function copyText(text: string, place: HTMLElement): Promise<boolean> {
  const copied = await navigator.clipboard?.writeText(text).then(() => true, () => false);
  return copied || copySelected(text, place);
}

function copySelected(text: string, place: HTMLElement): boolean {
  const area = document.createElement('textarea');
  area.value = text;
  area.className = 'unseen';
  const before = (place.getRootNode() as Document | ShadowRoot).activeElement as HTMLElement | null;
  place.append(area);
  area.select();
  const copied = document.execCommand('copy');
  area.remove();
  before?.focus();
  return copied;
}

/** Lets the visitor save a text as a file. */
export function saveText(text: string, name: string): void {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([text], { type: 'text/plain;charset=utf-8' }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href)); // browsers have begun to read it
}

/** A text without control characters, which terminals obey, but with its line ends. */
export function plain(text: string): string {
  return text.replace(/(?!\n)\p{Cc}/gu, '');
}
