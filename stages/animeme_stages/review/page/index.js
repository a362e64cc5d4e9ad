// The list of all lines: sorted, searched, and quick with ten thousand of them.

/**
 * @typedef {[key: string, character: string, language: string, status: string, audio_s: number,
 *   score: number | null, codes: number[], words: string, href: string | null]} Row
 * @typedef {{title: string, against: string, codes: string[], rows: Row[], findings: FindingData[]}} IndexData
 */

const ROW_PX = 44;
const SPARE_ROWS = 12;
const RANK = /** @type {Record<string, number>} */ ({ failed: 0, review: 1, ok: 2 });

/**
 * @typedef {{name: string, label: string, value: (row: Row) => string | number}} Column
 * @type {Column[]}
 */
const COLUMNS = [
  { name: "status", label: "Status", value: (row) => RANK[row[3]] ?? 3 },
  { name: "line", label: "Line", value: (row) => row[0] },
  { name: "character", label: "Character", value: (row) => row[1] },
  { name: "language", label: "Language", value: (row) => row[2] },
  { name: "length", label: "Length", value: (row) => row[4] },
  // The lowest first; what has no score comes last.
  { name: "score", label: "Worst phone", value: (row) => row[5] ?? Infinity },
  { name: "findings", label: "Findings", value: (row) => -row[6].length },
  { name: "mark", label: "Mark", value: () => 0 },
];

/** Shows the list. Only rows in sight are in the page. */
class IndexView {
  /** @param {HTMLElement} root @param {IndexData} data @param {Marks} marks */
  constructor(root, data, marks) {
    this._data = data;
    this._marks = marks;
    this._herald = new Herald();
    this._sorted = { column: "status", up: true };
    const some = data.rows.some((row) => row[8] === null) && data.rows.some((row) => row[8] !== null);
    this._wanted = { text: "", status: "", language: "", character: "", chosen: some };
    this._searched = data.rows.map((row) => `${row[0]} ${row[1]} ${row[7]} ${row[6].map((code) => data.codes[code]).join(" ")}`.toLowerCase());
    this._rows = data.rows.map((_, at) => at);
    this._at = 0;
    this._count = el("span", { class: "quiet", role: "status" });
    this._search = /** @type {HTMLInputElement} */ (el("input", { type: "search", placeholder: "Search lines, words, findings", "aria-label": "Search", "aria-keyshortcuts": "/" }));
    this._search.addEventListener("input", () => {
      this._at = 0;
      this._want({ text: this._search.value.toLowerCase() });
    });
    this._heads = COLUMNS.map((column) => this._header(column));
    this._body = el("div", { class: "body", role: "rowgroup" });
    this._scroller = el("div", { class: "list", tabindex: 0 }, this._body);
    this._table = el("div", { class: "table", role: "table", "aria-label": "Lines" }, el("div", { class: "row-line head", role: "row" }, ...this._heads), this._scroller);
    root.replaceChildren(this._top(), this._filters(), this._table, this._herald.element);
    this._scroller.addEventListener("scroll", () => this._draw());
    this._watcher = new ResizeObserver(() => this._draw());
    this._watcher.observe(this._scroller);
    /** @param {KeyboardEvent} event */
    this._onKey = (event) => this._key(event);
    addEventListener("keydown", this._onKey);
    marks.watchers.push(() => this._draw());
    this._sort();
  }

  close() {
    removeEventListener("keydown", this._onKey);
    this._watcher.disconnect();
  }

  _top() {
    const counts = /** @type {Record<string, number>} */ ({ ok: 0, review: 0, failed: 0 });
    for (const row of this._data.rows) counts[row[3]] = (counts[row[3]] ?? 0) + 1;
    const totals = Object.entries(counts).map(([status, count]) => {
      const pill = button(`${count} ${status}`, () => this._want({ status: this._wanted.status === status ? "" : status }), { class: `pill ${status}`, title: `Only ${status}` });
      return pill;
    });
    const against = this._data.against ? el("span", { class: "who", text: `against ${this._data.against}` }) : null;
    const found = this._data.findings;
    const general = found.length
      ? el("details", { class: "general" }, el("summary", { text: `${found.length} findings about the whole` }), el("ul", {}, ...found.map((f) => el("li", { class: f.severity, text: `${f.line ? `${f.line}: ` : ""}${f.message}. ${f.action}` }))))
      : null;
    return el("header", { class: "index-top" }, el("div", { class: "top" }, el("h1", {}, el("span", { text: this._data.title, dir: "auto" }), against), el("div", { class: "totals" }, ...totals), this._marks.exporters(this._herald)), general);
  }

  _filters() {
    /** @param {string} name @param {number} column @param {"language" | "character"} field */
    const choice = (name, column, field) => {
      const values = [...new Set(this._data.rows.map((row) => String(row[column])))].sort();
      const select = /** @type {HTMLSelectElement} */ (el("select", { "aria-label": name }, el("option", { value: "", text: `${name}: all` }), ...values.map((value) => el("option", { value, text: value || "–" }))));
      select.addEventListener("change", () => this._want({ [field]: select.value }));
      return values.length > 1 ? select : null;
    };
    const chosen = button("With a page", () => {
      this._want({ chosen: !this._wanted.chosen });
      chosen.setAttribute("aria-pressed", String(this._wanted.chosen));
    }, { pressed: true, title: "Only lines that can be looked at" });
    const some = this._wanted.chosen ? chosen : null;
    return el("div", { class: "filters", role: "search" }, this._search, choice("Language", 2, "language"), choice("Character", 1, "character"), some, this._count);
  }

  /** @param {Column} column */
  _header(column) {
    const press = button(column.label, () => {
      this._sorted = { column: column.name, up: this._sorted.column === column.name ? !this._sorted.up : true };
      this._sort();
    });
    return el("div", { class: `cell ${column.name}`, role: "columnheader" }, press);
  }

  /** @param {Partial<{text: string, status: string, language: string, character: string, chosen: boolean}>} change */
  _want(change) {
    this._wanted = { ...this._wanted, ...change };
    this._sort();
  }

  _sort() {
    const { text, status, language, character, chosen } = this._wanted;
    const { rows } = this._data;
    const terms = text.split(/\s+/).filter(Boolean);
    const kept = [];
    for (let at = 0; at < rows.length; at++) {
      const row = /** @type {Row} */ (rows[at]);
      const fits = (!status || row[3] === status) && (!language || row[2] === language) && (!character || row[1] === character) && (!chosen || row[8] !== null);
      if (fits && terms.every((term) => this._searched[at]?.includes(term))) kept.push(at);
    }
    const column = COLUMNS.find((each) => each.name === this._sorted.column);
    const values = rows.map((row) => (column?.name === "mark" ? (this._marks.of(row[0], row[1])?.mark ?? "~") : (column?.value(row) ?? 0)));
    const sign = this._sorted.up ? 1 : -1;
    kept.sort((a, b) => {
      const [left, right] = [values[a] ?? 0, values[b] ?? 0];
      if (left !== right) return left < right ? -sign : sign;
      const [one, two] = [rows[a]?.[5] ?? 0, rows[b]?.[5] ?? 0];
      return one - two || a - b;
    });
    this._rows = kept;
    this._at = Math.min(this._at, Math.max(0, kept.length - 1));
    COLUMNS.forEach((each, number) => this._heads[number]?.setAttribute("aria-sort", each.name !== this._sorted.column ? "none" : this._sorted.up ? "ascending" : "descending"));
    this._count.textContent = kept.length === rows.length ? `${rows.length} lines` : `${kept.length} of ${rows.length} lines`;
    this._table.setAttribute("aria-rowcount", String(kept.length + 1));
    this._body.style.height = `${kept.length * ROW_PX}px`;
    this._scroller.scrollTop = 0;
    this._draw();
  }

  _draw() {
    const first = Math.max(0, Math.floor(this._scroller.scrollTop / ROW_PX) - SPARE_ROWS);
    const last = Math.min(this._rows.length, Math.ceil((this._scroller.scrollTop + this._scroller.clientHeight) / ROW_PX) + SPARE_ROWS);
    const shown = [];
    for (let place = first; place < last; place++) shown.push(this._line(place));
    this._body.replaceChildren(...shown);
  }

  /** @param {number} place */
  _line(place) {
    const row = /** @type {Row} */ (this._data.rows[/** @type {number} */ (this._rows[place])]);
    const [key, character, language, status, audio_s, score, codes, words, href] = row;
    const mark = this._marks.of(key, character);
    const codesText = codes.map((code) => this._data.codes[code]).join(", ");
    /** @param {string} name @param {...Child} content */
    const cell = (name, ...content) => el("div", { class: `cell ${name}`, role: "cell" }, ...content);
    const name = el("span", { class: "name" }, el("b", { text: key, dir: "auto" }), el("span", { class: "said", text: words, dir: "auto", lang: language || null }));
    const made = el(
      "div",
      { class: `row-line${place === this._at ? " here" : ""}`, role: "row", "aria-rowindex": place + 2 },
      cell("status", statusPill(status)),
      cell("line", href === null ? el("span", { class: "link off", title: "This line has no page: it was not chosen" }, name) : el("a", { class: "link", href }, name)),
      cell("character", character),
      cell("language", language),
      cell("length", audio_s ? `${audio_s.toFixed(1)} s` : "–"),
      cell("score", score === null ? "–" : score.toFixed(1)),
      cell("findings", el("span", { text: codesText, title: codesText })),
      cell("mark", mark ? el("span", { class: `marked ${mark.mark}`, text: mark.mark, title: mark.note || null }) : null),
    );
    made.style.transform = `translateY(${place * ROW_PX}px)`;
    return made;
  }

  /** @param {number} by */
  _move(by) {
    this._at = clamp(this._at + by, 0, Math.max(0, this._rows.length - 1));
    const top = this._at * ROW_PX;
    if (top < this._scroller.scrollTop) this._scroller.scrollTop = top;
    const room = this._scroller.clientHeight - ROW_PX;
    if (top > this._scroller.scrollTop + room) this._scroller.scrollTop = top - room;
    this._draw();
    const row = this._data.rows[this._rows[this._at] ?? -1];
    if (row) this._herald.say(`${row[0]}, ${row[1]}, ${row[3]}`);
  }

  /** @param {KeyboardEvent} event */
  _key(event) {
    const searching = document.activeElement === this._search;
    if (searching && event.key === "Escape") this._search.blur();
    if (searching && event.key === "ArrowDown") {
      this._search.blur(); // on to what was found
      this._move(0);
      event.preventDefault();
      return;
    }
    if (isTyping(event) && !(searching && event.key === "Enter")) return;
    const page = Math.max(1, Math.floor(this._scroller.clientHeight / ROW_PX) - 1);
    const steps = /** @type {Record<string, number>} */ ({ ArrowDown: 1, j: 1, ArrowUp: -1, k: -1, PageDown: page, PageUp: -page, Home: -1e9, End: 1e9 });
    const by = steps[event.key];
    const row = this._data.rows[this._rows[this._at] ?? -1];
    if (by !== undefined) this._move(by);
    else if (event.key === "/") this._search.select(); // which focuses it too
    else if (event.key === "Enter" && !(/** @type {HTMLElement} */ (event.target).matches("a, button")) && row?.[8]) location.href = row[8];
    else if ((event.key === "g" || event.key === "f") && row) {
      const mark = event.key === "g" ? "good" : "fix";
      const old = this._marks.of(row[0], row[1]);
      this._marks.set(row[0], row[1], old?.mark === mark ? null : mark, old?.note ?? "");
    } else return;
    event.preventDefault();
  }
}
