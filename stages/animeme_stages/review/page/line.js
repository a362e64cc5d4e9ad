// The page of a line.

/** @typedef {{up: string | null, before: string | null, after: string | null}} Around */

const KEYS = /** @type {[string, string][]} */ ([
  ["Space", "play, pause"],
  ["← →", "a frame back, on"],
  ["Shift ← →", "half a second back, on"],
  ["Home End", "to the start, to the end"],
  ["[ ]", "start, end of the loop"],
  ["l", "loop on, off"],
  ["< >", "slower, faster"],
  ["+ −", "show less, more time"],
  ["n N", "next finding, the one before"],
  ["g f", "mark good, to fix"],
  ["m", "write a note (Esc ends it)"],
  ["j k", "next line, the one before"],
  ["i", "to the list of lines"],
  ["?", "this list"],
]);

/** Shows one line, plays it, takes marks. */
class LineView {
  /**
   * @param {HTMLElement} root
   * @param {LineData} line
   * @param {Around} around - where to go from here
   * @param {Marks} marks
   * @param {(name: string) => string} soundOf - where a recording is
   */
  constructor(root, line, around, marks, soundOf) {
    this._line = line;
    this._around = around;
    const palette = new Palette();
    this._herald = new Herald();
    const takes = line.takes.map((take) => new Take(take));
    const first_s = Math.min(0, ...takes.map((take) => -take.lead_s));
    const last_s = Math.max(line.duration_s, ...takes.map((take) => take.end_s - take.lead_s));
    this.clock = new Clock(this._audio(soundOf), first_s, last_s);
    this._chosen = new Chosen(palette);
    this._timeline = new Timeline(line, this.clock, palette, this._chosen);
    this._transcript = new Transcript(line, this.clock);
    if (!line.events.length && !line.findings.some((finding) => finding.when_s)) this._timeline.element.classList.add("no-notes");
    this._findings = new Findings(line, this.clock, this._herald);
    this._marks = new MarkBox(line, marks, this._herald);
    this._player = new Player(this.clock, line.frame_hz, (factor) => this._timeline.zoomBy(factor));
    this._heads = new Heads(`The head that says “${line.text}”`);
    this._help = this._helpBox();
    this._sides = new Map([["A", takes.filter((t) => t.side === "A")], ["B", takes.filter((t) => t.side === "B")]]);
    root.replaceChildren(this._top(), this._main(), this._player.element, this._timeline.element, this._chosen.element, this._help, this._herald.element);
    this._select(0);
    /** @param {KeyboardEvent} event */
    this._onKey = (event) => this._key(event);
    addEventListener("keydown", this._onKey);
    this._frame = requestAnimationFrame((now) => this._tick(now));
    this._told_ms = 0;
  }

  /** What is said where the head would be. */
  get _why() {
    const lost = this._line.takes.length ? "" : "Nothing was written for this line.";
    return this._line.remarks.find((text) => /\b(head|3D)\b/.test(text)) ?? lost;
  }

  /** @param {(name: string) => string} soundOf */
  _audio(soundOf) {
    if (!this._line.audio) return null;
    const audio = new Audio();
    audio.preload = "auto";
    audio.src = soundOf(this._line.audio);
    return audio;
  }

  close() {
    this.clock.pause();
    cancelAnimationFrame(this._frame);
    removeEventListener("keydown", this._onKey);
    this._timeline.close();
    this._heads.close();
  }

  _top() {
    const { up, before, after } = this._around;
    /** @param {string | null} href @param {string} text @param {string} key */
    const link = (href, text, key) => (href === null ? el("span", { class: "link off", text }) : el("a", { class: "link", href, title: `${text} (${key})`, text }));
    return el(
      "header",
      { class: "top" },
      link(up, "‹ All lines", "i"),
      el("h1", {}, el("span", { text: this._line.key, dir: "auto" }), el("span", { class: "who", text: this._line.character })),
      statusPill(this._line.status),
      el("nav", { "aria-label": "Lines" }, link(before, "‹ Before", "k"), link(after, "Next ›", "j"), button("Keys", () => this._toggleHelp(), { icon: "?", key: "?", class: "round" })),
    );
  }

  _main() {
    const remarks = this._line.remarks.filter((text) => text !== this._why).map((text) => el("p", { class: "remark", text }));
    const files = Math.max(...[...this._sides.values()].map((takes) => takes.length), 0);
    const chooser = files > 1 ? this._chooser() : null;
    const text = this._line.text || this._line.words.length ? this._transcript.element : el("p", { class: "transcript quiet", text: "Nothing is known of its words." });
    return el("main", { class: "main" }, this._heads.element, el("div", { class: "side" }, text, chooser, ...remarks, this._findings.element, this._marks.element));
  }

  /** The same motion in another file: of glTF, of USD. */
  _chooser() {
    const files = this._sides.get("A") ?? [];
    const buttons = files.map((take, at) => button(take.file, () => {
      this._select(at);
      buttons.forEach((each, number) => each.setAttribute("aria-pressed", String(number === at)));
    }, { pressed: at === 0 }));
    return el("div", { class: "files", role: "group", "aria-label": "File" }, ...buttons);
  }

  /** @param {number} at */
  _select(at) {
    const chosen = [...this._sides.values()].flatMap((takes) => takes[Math.min(at, takes.length - 1)] ?? []);
    chosen.forEach((take) => take.sample(this.clock.now_s));
    this._chosen.show(chosen);
    this._takes = chosen;
    void this._heads.show(chosen, this._why);
  }

  /** @param {number} now_ms */
  _tick(now_ms) {
    this.clock.tick(now_ms);
    const at_s = this.clock.now_s;
    for (const take of this._takes ?? []) take.sample(at_s);
    this._heads.draw();
    this._timeline.draw();
    this._transcript.draw(at_s);
    this._player.draw();
    if (now_ms - this._told_ms > 80) {
      this._chosen.tell();
      this._told_ms = now_ms;
    }
    this._frame = requestAnimationFrame((next) => this._tick(next));
  }

  _helpBox() {
    const rows = KEYS.flatMap(([keys, text]) => [el("dt", { text: keys }), el("dd", { text })]);
    const box = el("dialog", { class: "help", "aria-label": "Keys" }, el("h2", { text: "Keys" }), el("dl", {}, ...rows), el("form", { method: "dialog" }, el("button", { text: "Close" })));
    box.querySelector("form")?.addEventListener("submit", (event) => {
      event.preventDefault();
      /** @type {HTMLDialogElement} */ (box).close();
    });
    return /** @type {HTMLDialogElement} */ (box);
  }

  _toggleHelp() {
    if (this._help.open) this._help.close();
    else this._help.showModal();
  }

  /** @param {string | null} href */
  _go(href) {
    if (href !== null) location.href = href;
  }

  /** @param {KeyboardEvent} event */
  _key(event) {
    if (event.key === "Escape" && document.activeElement === this._marks.note) this._marks.note.blur();
    if (isTyping(event)) return;
    const { clock } = this;
    const half = event.shiftKey ? 0.5 : 0;
    /** @type {Record<string, () => void>} */
    const does = {
      " ": () => clock.toggle(),
      ArrowLeft: () => (half ? clock.seek(clock.now_s - half) : clock.step(-1, this._line.frame_hz)),
      ArrowRight: () => (half ? clock.seek(clock.now_s + half) : clock.step(1, this._line.frame_hz)),
      Home: () => clock.seek(0),
      End: () => clock.seek(clock.end_s),
      "[": () => clock.setLoop([clock.now_s, clock.loop && clock.loop[1] > clock.now_s ? clock.loop[1] : clock.end_s]),
      "]": () => clock.setLoop([clock.loop && clock.loop[0] < clock.now_s ? clock.loop[0] : clock.start_s, clock.now_s]),
      l: () => this._player.toggleLoop(),
      "<": () => this._player.changeRate(-1),
      ">": () => this._player.changeRate(1),
      "+": () => this._timeline.zoomBy(1.5),
      "=": () => this._timeline.zoomBy(1.5),
      "-": () => this._timeline.zoomBy(1 / 1.5),
      n: () => this._findings.next(1),
      N: () => this._findings.next(-1),
      g: () => this._marks.toggle("good"),
      f: () => this._marks.toggle("fix"),
      m: () => this._marks.note.focus(),
      j: () => this._go(this._around.after),
      k: () => this._go(this._around.before),
      i: () => this._go(this._around.up),
      "?": () => this._toggleHelp(),
    };
    const act = does[event.key];
    // A button that has the focus takes the space bar itself.
    if (!act || this._help.open || (event.key === " " && /** @type {HTMLElement} */ (event.target).matches("button, a"))) return;
    event.preventDefault();
    act();
  }
}
