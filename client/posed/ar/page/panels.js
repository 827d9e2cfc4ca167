/** The panels, of which at most one is open; the focus goes in with it and comes back after. */

const PANELS = ["book", "correct", "settings", "help"];

export class Panels {
  /** @param {function(string): void} opened  told the id of a panel before it shows */
  constructor(opened) {
    this._opened = opened;
    this._cameFrom = null;
    this.open = null;
    for (const button of document.querySelectorAll("[data-panel]")) {
      button.setAttribute("aria-controls", button.dataset.panel);
      button.addEventListener("click", () => this.toggle(button.dataset.panel));
    }
    for (const button of document.querySelectorAll("[data-close]")) {
      button.addEventListener("click", () => this.close());
    }
  }

  toggle(id) {
    if (this.open === id) {
      this.close();
      return;
    }
    if (this.open === null) this._cameFrom = document.activeElement;
    this._show(id);
    document.querySelector(`#${id} h2`).focus();
  }

  close() {
    if (this.open === null) return;
    this._show(null);
    this._cameFrom?.focus();
  }

  _show(id) {
    this.open = id;
    if (id !== null) this._opened(id);
    for (const panel of PANELS) document.getElementById(panel).hidden = panel !== id;
    for (const button of document.querySelectorAll("[data-panel]")) {
      button.setAttribute("aria-expanded", `${button.dataset.panel === id}`);
    }
  }
}

/** Make an element with text or children. */
export function make(tag, attributes, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}
