// Elements, text and numbers. Text from outside goes into a page through `el` alone, as text.

/**
 * @typedef {Record<string, string | number | boolean | null | undefined>} Attributes
 * @typedef {Node | string | null | undefined} Child
 */

/**
 * Make an element.
 *
 * @param {string} tag
 * @param {Attributes} [attributes] - `text` is its content; false, null and undefined are left out
 * @param {...Child} children
 * @returns {HTMLElement}
 */
function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name === "text") made.textContent = String(value);
    else made.setAttribute(name, value === true ? "" : String(value));
  }
  made.append(...children.filter((child) => child !== null && child !== undefined).map((child) => child));
  return made;
}

/**
 * Make a button.
 *
 * @param {string} label - what it says, or what it is called if `icon` is shown
 * @param {() => void} press
 * @param {{icon?: string, key?: string, title?: string, class?: string, pressed?: boolean}} [more]
 * @returns {HTMLButtonElement}
 */
function button(label, press, more = {}) {
  const key = more.key ? ` (${more.key})` : "";
  const made = /** @type {HTMLButtonElement} */ (
    el("button", {
      type: "button",
      class: more.class,
      title: `${more.title ?? label}${key}`,
      "aria-label": more.icon ? label : null,
      "aria-keyshortcuts": more.key,
      "aria-pressed": more.pressed === undefined ? null : String(more.pressed),
      text: more.icon ?? label,
    })
  );
  made.addEventListener("click", press);
  return made;
}

/**
 * Seconds as m:ss.cc.
 *
 * @param {number} seconds
 */
function clockText(seconds) {
  const sign = seconds < 0 ? "−" : "";
  const hundredths = Math.round(Math.abs(seconds) * 100);
  const rest = hundredths % 6000;
  const text = `${Math.floor(rest / 100)}`.padStart(2, "0");
  return `${sign}${Math.floor(hundredths / 6000)}:${text}.${`${rest % 100}`.padStart(2, "0")}`;
}

/**
 * The bytes that base64 stands for.
 *
 * @param {string} text
 * @returns {Uint8Array<ArrayBuffer>}
 */
function bytesOf(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let at = 0; at < raw.length; at++) bytes[at] = raw.charCodeAt(at);
  return bytes;
}

/** @param {number} value @param {number} low @param {number} high */
function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

/**
 * Index of the last of some ascending times that is not after `at`; -1 if all are.
 *
 * @param {ArrayLike<number>} times
 * @param {number} at
 */
function lastBefore(times, at) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (/** @type {number} */ (times[middle]) <= at) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Colours of the style sheet, as it is now: light or dark. */
class Palette {
  constructor() {
    this.faint = this.line = this.wave = this.closure = "";
    /** @type {string[]} */
    this.curves = [];
    this.read();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.read());
  }

  read() {
    const style = getComputedStyle(document.documentElement);
    /** @param {string} name */
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    this.faint = colour("faint");
    this.line = colour("line");
    this.wave = colour("wave");
    this.closure = colour("closure");
    this.curves = Array.from({ length: 10 }, (_, number) => colour(`curve-${number}`));
  }
}

/** Tells screen readers what happened. */
class Herald {
  constructor() {
    this.element = el("div", { class: "unseen", role: "status", "aria-live": "polite" });
  }

  /** @param {string} text */
  say(text) {
    this.element.textContent = text;
  }
}

/**
 * A file that the browser saves.
 *
 * @param {string} name
 * @param {string} type
 * @param {string} text
 */
function save(name, type, text) {
  const link = /** @type {HTMLAnchorElement} */ (el("a", { download: name }));
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

const STATUS_TEXT = /** @type {Record<string, string>} */ ({
  ok: "ok",
  review: "review",
  failed: "failed",
});

/** @param {string} status */
function statusPill(status) {
  return el("span", { class: `pill ${status}`, text: STATUS_TEXT[status] ?? status });
}

/** Whether a key press is meant for what has the focus. @param {KeyboardEvent} event */
function isTyping(event) {
  const target = /** @type {HTMLElement} */ (event.target);
  return event.ctrlKey || event.metaKey || event.altKey || target.matches("input:not([type=range]), textarea, select");
}
