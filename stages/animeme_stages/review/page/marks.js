// What a person thinks of each line: kept by the browser, handed out as a file.

/** @typedef {{line: string, character: string, mark: "good" | "fix", note: string}} Mark */

const MARKS_SCHEMA = "animeme.marks/1";
const MARKS_HEADER = ["line", "character", "mark", "note"];

/** Marks of one run. */
class Marks {
  /**
   * @param {string} title - of the run; marks of another are others
   * @param {boolean} pages - whether the review has a page for each line
   */
  constructor(title, pages) {
    this._place = `animeme.marks:${title}`;
    // To Firefox each file is an origin of its own; nothing but its name tells that to a page.
    this._alone = pages && location.protocol === "file:" && navigator.userAgent.includes("Firefox/");
    /** @type {Map<string, Mark>} */
    this._marks = new Map();
    this.kept = true;
    this.read();
    // Another tab may have marked something.
    addEventListener("storage", (event) => event.key === this._place && this.read());
    /** @type {(() => void)[]} */
    this.watchers = [];
  }

  /** Take up what the browser has kept. */
  read() {
    try {
      const text = localStorage.getItem(this._place);
      if (text) this.take(JSON.parse(text));
    } catch {
      this.kept = false; // no storage for pages from disk: the marks last as long as the page
    }
    this.watchers?.forEach((told) => told());
  }

  /**
   * Take up marks from a document; its own go before those that are there.
   *
   * @param {unknown} document
   * @returns {number} how many there were
   */
  take(document) {
    const found = /** @type {{schema?: unknown, marks?: unknown}} */ (document ?? {});
    if (found.schema !== MARKS_SCHEMA || !Array.isArray(found.marks)) throw new Error("no marks");
    for (const entry of found.marks) {
      if (entry.mark !== "good" && entry.mark !== "fix") continue;
      const mark = { line: String(entry.line), character: String(entry.character), mark: entry.mark, note: String(entry.note ?? "") };
      this._marks.set(this._key(mark.line, mark.character), mark);
    }
    return found.marks.length;
  }

  /** @param {string} line @param {string} character */
  _key(line, character) {
    return JSON.stringify([line, character]);
  }

  /** @param {string} line @param {string} character @returns {Mark | undefined} */
  of(line, character) {
    return this._marks.get(this._key(line, character));
  }

  /**
   * Mark a line, or take its mark away.
   *
   * @param {string} line
   * @param {string} character
   * @param {"good" | "fix" | null} mark
   * @param {string} note
   */
  set(line, character, mark, note) {
    const key = this._key(line, character);
    if (mark === null) this._marks.delete(key);
    else this._marks.set(key, { line, character, mark, note });
    try {
      localStorage.setItem(this._place, this.json());
    } catch {
      this.kept = false;
    }
    this.watchers.forEach((told) => told());
  }

  /** @returns {Mark[]} sorted by line, then by character */
  all() {
    /** @param {string} a @param {string} b */
    const order = (a, b) => (a < b ? -1 : a > b ? 1 : 0);
    return [...this._marks.values()].sort((a, b) => order(a.line, b.line) || order(a.character, b.character));
  }

  /** The document ``animeme.marks/1``. */
  json() {
    return `${JSON.stringify({ schema: MARKS_SCHEMA, marks: this.all() }, null, 1)}\n`;
  }

  /** A table with the columns line, character, mark and note (RFC 4180). */
  csv() {
    /** @param {string} text */
    const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const rows = this.all().map((mark) => [mark.line, mark.character, mark.mark, mark.note]);
    return [MARKS_HEADER, ...rows].map((row) => `${row.map(quoted).join(",")}\r\n`).join("");
  }

  /**
   * Buttons that save all marks, or read a file of them.
   *
   * @param {Herald} herald
   */
  exporters(herald) {
    const why = this._alone ? "To have the marks of all lines together, review with --single-file, put the folder on a web server, or open it in another browser" : null;
    const counted = el("span", { class: "quiet", title: why });
    const told = () => {
      const all = this.all();
      const fix = all.filter((mark) => mark.mark === "fix").length;
      counted.textContent = all.length ? `${all.length - fix} good, ${fix} to fix` : "no marks yet";
      if (!this.kept) counted.textContent += " — this browser forgets them with the page: export them";
      else if (this._alone) counted.textContent += " on this page — Firefox keeps those of each page alone";
    };
    told();
    this.watchers.push(told);
    const file = /** @type {HTMLInputElement} */ (el("input", { type: "file", accept: ".json", class: "unseen", tabindex: -1, "aria-hidden": true }));
    file.addEventListener("change", async () => {
      try {
        for (const chosen of file.files ?? []) herald.say(`${this.take(JSON.parse(await chosen.text()))} marks read`);
        localStorage.setItem(this._place, this.json());
      } catch {
        herald.say("That file holds no marks.");
        counted.textContent = "that file holds no marks";
        return;
      }
      this.watchers.forEach((each) => each());
    });
    return el(
      "div",
      { class: "exporters" },
      counted,
      button("Export JSON", () => save("marks.json", "application/json", this.json())),
      button("Export CSV", () => save("marks.csv", "text/csv", this.csv())),
      button("Import…", () => file.click(), { title: "Add marks from a file that was exported" }),
      file,
    );
  }
}
