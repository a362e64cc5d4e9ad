// Parts of a line's page: which curves are shown, the transcript, findings, marks, the player.

const SHOWN_AT_FIRST = 5;

/** The first few of some curves; of a left and a right one, the left. @param {string[]} names */
function firstOf(names) {
  const twin = /** @param {string} name */ (name) => name.replace(/right/i, (side) => (side === "Right" ? "Left" : "left")).replace(/_R\b/, "_L");
  return names.filter((name) => twin(name) === name || !names.includes(twin(name))).slice(0, SHOWN_AT_FIRST);
}

/** Curves that are shown, with the list that chooses them. */
class Chosen {
  /** @param {Palette} palette */
  constructor(palette) {
    this._palette = palette;
    /** @type {Take[]} */
    this.takes = [];
    /** @type {Map<string, number>} name → its colour */
    this._shown = new Map();
    this.version = 0;
    this._strong = "";
    this._list = el("div", { class: "chips", role: "group", "aria-label": "Curves" });
    const filter = /** @type {HTMLInputElement} */ (el("input", { type: "search", placeholder: "Find a curve", "aria-label": "Find a curve" }));
    filter.addEventListener("input", () => this._filter(filter.value));
    this.element = el(
      "section",
      { class: "legend", "aria-label": "Curves" },
      el("div", { class: "legend-tools" }, filter, button("Most moved", () => this._first()), button("All", () => this._all()), button("None", () => this._none())),
      this._list,
    );
    /** @type {Map<string, {chip: HTMLElement, value: HTMLElement}>} */
    this._chips = new Map();
  }

  /** @param {Take[]} takes */
  show(takes) {
    const before = [...this._shown.keys()];
    this.takes = takes;
    const names = [...new Set(takes.flatMap((take) => take.ranked()))];
    this._chips.clear();
    this._list.replaceChildren(...names.map((name) => this._chip(name)));
    this._shown.clear();
    const kept = before.filter((name) => this._chips.has(name));
    for (const name of kept.length ? kept : firstOf(names)) this._set(name, true);
    this._changed();
  }

  /** @param {string} name */
  _chip(name) {
    const value = el("span", { class: "value" });
    const chip = button(name, () => {
      this._set(name, !this._shown.has(name));
      this._changed();
    }, { class: "chip", pressed: false });
    chip.replaceChildren(el("span", { class: "swatch" }), el("span", { text: name }), value);
    chip.addEventListener("pointerenter", () => this._mark(name));
    chip.addEventListener("pointerleave", () => this._mark(""));
    this._chips.set(name, { chip, value });
    return chip;
  }

  /** @param {string} name */
  _mark(name) {
    this._strong = name;
    this.version++;
  }

  /** @param {string} name @param {boolean} on */
  _set(name, on) {
    const entry = this._chips.get(name);
    if (!entry) return;
    if (on) {
      const taken = new Set(this._shown.values());
      let colour = 0;
      while (taken.has(colour) && colour < 9) colour++;
      if (taken.has(colour)) colour = this._shown.size % 10;
      this._shown.set(name, colour);
      entry.chip.style.setProperty("--colour", `var(--curve-${colour})`);
    } else this._shown.delete(name);
    entry.chip.setAttribute("aria-pressed", String(on));
    entry.value.textContent = "";
  }

  _changed() {
    this.version++;
    this.tell();
  }

  _first() {
    this._none();
    firstOf([...this._chips.keys()]).forEach((name) => this._set(name, true));
    this._changed();
  }

  _all() {
    for (const [name, { chip }] of this._chips) if (!chip.hidden && !this._shown.has(name)) this._set(name, true);
    this._changed();
  }

  _none() {
    for (const name of [...this._shown.keys()]) this._set(name, false);
    this._changed();
  }

  /** @param {string} text */
  _filter(text) {
    const wanted = text.toLowerCase();
    for (const [name, { chip }] of this._chips) chip.hidden = !name.toLowerCase().includes(wanted);
  }

  /** Lowest and highest weight that the lane shows. */
  range() {
    let [low, high] = [0, 0.5];
    for (const { take, column } of this.curves()) {
      const [least, most] = take.range(column);
      low = Math.min(low, least);
      high = Math.max(high, most);
    }
    return /** @type {[number, number]} */ ([low, Math.ceil(high * 4) / 4]);
  }

  /** @returns {{take: Take, column: number, colour: string, strong: boolean}[]} */
  curves() {
    return this.takes.flatMap((take) =>
      [...this._shown].flatMap(([name, number]) => {
        const column = take.names.indexOf(name);
        const colour = this._palette.curves[number] || "#888";
        return column < 0 ? [] : [{ take, column, colour, strong: name === this._strong }];
      }),
    );
  }

  /** Write the weights of now beside the names. */
  tell() {
    for (const name of this._shown.keys()) {
      const said = this.takes.map((take) => {
        const column = take.names.indexOf(name);
        return column < 0 ? "–" : (take.now[column] ?? 0).toFixed(2);
      });
      const entry = this._chips.get(name);
      const text = said.join(" | ");
      if (entry && entry.value.textContent !== text) entry.value.textContent = text;
    }
  }
}

/** The transcript; the word that is spoken stands out, a press on one jumps to it. */
class Transcript {
  /** @param {LineData} line @param {Clock} clock */
  constructor(line, clock) {
    this._words = line.words;
    this.element = el("p", { class: "transcript", lang: line.language || null, dir: "auto" });
    /** @type {HTMLElement[]} */
    this._marks = [];
    let at = 0;
    for (const [text, start_s, , from, to] of line.words) {
      const whole = from >= at && to <= line.text.length && to > from;
      if (whole && from > at) this.element.append(line.text.slice(at, from));
      const said = whole ? line.text.slice(from, to) : text;
      const mark = button(said, () => clock.seek(start_s), { class: "word", title: `${start_s.toFixed(2)} s` });
      this._marks.push(mark);
      if (!whole) this.element.append(" ");
      this.element.append(mark);
      if (whole) at = to;
    }
    this.element.append(line.text.slice(at));
    this._now = -1;
  }

  /** @param {number} at_s */
  draw(at_s) {
    const now = this._words.findIndex(([, start_s, end_s]) => at_s >= start_s && at_s < end_s);
    if (now === this._now) return;
    this._marks[this._now]?.removeAttribute("aria-current");
    this._marks[now]?.setAttribute("aria-current", "true");
    this._now = now;
  }
}

/** The findings as a list; those that say when jump there. */
class Findings {
  /** @param {LineData} line @param {Clock} clock @param {Herald} herald */
  constructor(line, clock, herald) {
    this._clock = clock;
    this._herald = herald;
    this._items = line.findings.map((finding) => {
      const when = finding.when_s ? `${finding.when_s[0].toFixed(2)} s` : "";
      const item = el(
        "li",
        { class: finding.when_s ? `timed ${finding.severity}` : finding.severity },
        finding.when_s ? button(`Jump to ${when}`, () => this.jump(finding), { icon: when, class: "when" }) : null,
        el("span", { class: "message", text: `${finding.message}.` }),
        finding.action ? el("span", { class: "action", text: finding.action }) : null,
        el("span", { class: "code", text: finding.place && !finding.place.includes("/") ? `${finding.code} · ${finding.place}` : finding.code }),
      );
      return { finding, item };
    });
    const timed = this._items.filter(({ finding }) => finding.when_s).map(({ finding }) => finding);
    this._timed = timed.sort((a, b) => (a.when_s?.[0] ?? 0) - (b.when_s?.[0] ?? 0));
    const none = el("p", { class: "quiet", text: "Nothing was found." });
    this.element = el("section", { class: "findings-panel", "aria-label": "Findings" }, el("h2", { text: "Findings" }), this._items.length ? el("ul", {}, ...this._items.map(({ item }) => item)) : none);
  }

  /** @param {FindingData} finding */
  jump(finding) {
    if (!finding.when_s) return;
    this._clock.seek(finding.when_s[0]);
    for (const { finding: each, item } of this._items) {
      item.classList.toggle("here", each === finding);
      if (each === finding) item.scrollIntoView({ block: "nearest" });
    }
    this._herald.say(`${finding.severity}: ${finding.message}`);
  }

  /** Jump to the next one, or the one before; from the last to the first. @param {number} by */
  next(by) {
    if (!this._timed.length) return this._herald.say("No finding says when.");
    const now = this._clock.now_s;
    /** @param {FindingData} finding */
    const start = (finding) => finding.when_s?.[0] ?? 0;
    const after = this._timed.find((finding) => start(finding) > now + 0.002);
    const before = this._timed.findLast((finding) => start(finding) < now - 0.002);
    const found = by > 0 ? (after ?? this._timed[0]) : (before ?? this._timed.at(-1));
    if (found) this.jump(found);
  }
}

/** Good, to fix, and a note. */
class MarkBox {
  /** @param {LineData} line @param {Marks} marks @param {Herald} herald */
  constructor(line, marks, herald) {
    this._line = line;
    this._marks = marks;
    this._herald = herald;
    this._good = button("Good", () => this.toggle("good"), { key: "g", class: "good", pressed: false });
    this._fix = button("Fix", () => this.toggle("fix"), { key: "f", class: "fix", pressed: false });
    this.note = /** @type {HTMLTextAreaElement} */ (el("textarea", { rows: 2, placeholder: "Note for whoever mends it", "aria-label": "Note" }));
    this.note.addEventListener("input", () => this._keepNote());
    this.element = el("section", { class: "marks-panel", "aria-label": "Mark" }, el("h2", { text: "Mark" }), el("div", { class: "mark-buttons" }, this._good, this._fix), this.note, marks.exporters(herald));
    marks.watchers.push(() => this._show());
    this._show();
  }

  get _mark() {
    return this._marks.of(this._line.key, this._line.character);
  }

  _show() {
    const mark = this._mark;
    this._good.setAttribute("aria-pressed", String(mark?.mark === "good"));
    this._fix.setAttribute("aria-pressed", String(mark?.mark === "fix"));
    if (mark && document.activeElement !== this.note) this.note.value = mark.note;
  }

  /** A note is one about what has to be mended, until somebody says that it is good. */
  _keepNote() {
    const mark = this._mark?.mark ?? "fix";
    this._marks.set(this._line.key, this._line.character, mark, this.note.value);
  }

  /** @param {"good" | "fix"} mark */
  toggle(mark) {
    const now = this._mark?.mark === mark ? null : mark;
    this._marks.set(this._line.key, this._line.character, now, this.note.value);
    this._herald.say(now ? `Marked ${now === "fix" ? "to fix" : now}` : "Mark taken away");
  }
}

const RATES = [0.1, 0.25, 0.5, 0.75, 1, 1.5, 2];

/** Buttons that play, and where playing is. */
class Player {
  /** @param {Clock} clock @param {number} frame_hz @param {(factor: number) => void} zoom */
  constructor(clock, frame_hz, zoom) {
    this._clock = clock;
    this._frame_hz = frame_hz;
    this._play = button("Play", () => clock.toggle(), { icon: "▶", key: "Space", class: "play" });
    this._time = el("output", { class: "time", "aria-label": "Time" });
    this._slider = /** @type {HTMLInputElement} */ (el("input", { type: "range", min: clock.start_s, max: clock.end_s, step: 0.01, "aria-label": "Position in seconds" }));
    this._slider.addEventListener("input", () => clock.seek(Number(this._slider.value)));
    const speed = /** @type {HTMLSelectElement} */ (el("select", { "aria-label": "Speed", title: "Speed" }, ...RATES.map((rate) => el("option", { value: rate, text: `${rate}×`, selected: rate === 1 }))));
    speed.addEventListener("change", () => clock.setRate(Number(speed.value)));
    this._speed = speed;
    this._loop = button("Loop", () => this.toggleLoop(), { key: "l", title: "Repeat all, or what is dragged over the sound", pressed: false });
    this._silent = el("p", { class: "remark", role: "status" });
    this.element = el(
      "section",
      { class: "player", "aria-label": "Player" },
      el("div", { class: "group" }, button("To the start", () => clock.seek(0), { icon: "|◂", key: "Home" }), button("A frame back", () => clock.step(-1, frame_hz), { icon: "◂", key: "←" }), this._play, button("A frame on", () => clock.step(1, frame_hz), { icon: "▸", key: "→" })),
      this._time,
      this._slider,
      el("div", { class: "group" }, speed, this._loop),
      el("div", { class: "group" }, button("Show more time", () => zoom(1 / 1.5), { icon: "−", key: "-" }), button("Show less time", () => zoom(1.5), { icon: "+", key: "+" })),
      this._silent,
    );
    clock.watchers.push(() => this._show());
    this._show();
  }

  toggleLoop() {
    this._clock.setLoop(this._clock.loop ? null : [this._clock.start_s, this._clock.end_s]);
  }

  /** The next speed, or the one before. @param {number} by */
  changeRate(by) {
    const at = clamp(RATES.indexOf(this._clock.rate) + by, 0, RATES.length - 1);
    this._clock.setRate(RATES[at] ?? 1);
    this._speed.value = String(this._clock.rate);
  }

  _show() {
    this._play.textContent = this._clock.playing ? "❚❚" : "▶";
    this._play.setAttribute("aria-label", this._clock.playing ? "Pause" : "Play");
    this._loop.setAttribute("aria-pressed", String(this._clock.loop !== null));
    if (this._silent.textContent !== this._clock.silent) this._silent.textContent = this._clock.silent;
  }

  draw() {
    const at_s = this._clock.now_s;
    const frame = Math.round(at_s * this._frame_hz);
    const text = `${clockText(at_s)}  f ${frame}`;
    if (this._time.textContent !== text) this._time.textContent = text;
    if (document.activeElement !== this._slider || this._clock.playing) this._slider.value = String(at_s);
  }
}
