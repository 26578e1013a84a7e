/** Lets a button open and close a sheet; of the sheets whose buttons stand together one is open at a time. */
export function makeDisclosure(button: HTMLElement, sheet: HTMLElement): void {
  button.onclick = () => {
    const opens = sheet.hidden;
    if (opens) button.parentElement!.querySelector<HTMLElement>('[aria-expanded=true]')?.click();
    sheet.hidden = !opens;
    button.setAttribute('aria-expanded', String(opens));
  };
}
