// Elements from names, attributes and children; text is only ever text.
type Child = Node | string | null;

export function el<K extends keyof HTMLElementTagNameMap>(
    tag: K, attributes: Record<string, string> = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children.filter((child): child is Node | string => child !== null));
  return element;
}

export function button(text: string, label: string, act: () => void, key = ''): HTMLButtonElement {
  const made = el('button', {type: 'button', title: key ? `${label} (${key})` : label}, text);
  if (!/[a-z]/i.test(text)) made.setAttribute('aria-label', label);  // words speak for themselves
  made.addEventListener('click', act);
  return made;
}

const SVG = 'http://www.w3.org/2000/svg';

export function svg(tag: string, attributes: Record<string, string | number>, ...children: (Node | string)[]): SVGElement {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  element.append(...children);
  return element;
}
