// The timeline: sound, words, phones, findings and curves above one another.

/**
 * @typedef {[text: string, start_s: number, end_s: number, from: number, to: number]} WordData
 * @typedef {[symbol: string, ipa: string, start_s: number, end_s: number, score: number | null]} PhoneData
 * @typedef {{severity: string, code: string, message: string, action: string, place: string,
 *   line: string, when_s: [number, number] | null}} FindingData
 * @typedef {{key: string, character: string, language: string, status: string, text: string,
 *   duration_s: number, frame_hz: number, audio: string | null,
 *   peaks: {rate_hz: number, data: string} | null, words: WordData[], phones: PhoneData[],
 *   events: [string, number][], findings: FindingData[], takes: TakeData[],
 *   remarks: string[]}} LineData
 */

const SILENT = "sil";
// Lips must meet in these; the lane of the curves shows where.
const BILABIALS = new Set(["p", "b", "m", "pʼ", "ɓ", "ʙ", "ɸ", "β"]);
// Mean log score per 10 ms frame that looks doubtful; right phones of clean speech lie above.
const POOR_SCORE = -12;
const CURVES_HEIGHT = 190;
const MOST_PX_PER_S = 4000;

/** The timeline of one line. */
class Timeline {
  /**
   * @param {LineData} line
   * @param {Clock} clock
   * @param {Palette} palette
   * @param {Chosen} chosen - curves that are shown
   */
  constructor(line, clock, palette, chosen) {
    this._line = line;
    this._clock = clock;
    this._palette = palette;
    this._chosen = chosen;
    this.peaks = line.peaks ? new Int8Array(bytesOf(line.peaks.data).buffer) : null;
    this.zoom = 1;
    this._drawn = "";
    this._ruler = new Lane("ruler", 22);
    this._wave = new Lane("wave", 64);
    this._curves = new Lane("curves", CURVES_HEIGHT);
    this._head = el("div", { class: "playhead", "aria-hidden": true });
    this._loop = el("div", { class: "loop", "aria-hidden": true, hidden: true });
    this._rows = el(
      "div",
      { class: "rows" },
      this._ruler.canvas,
      this._wave.canvas,
      this._row("words", "Words", line.words.map((word) => this._word(word))),
      this._row("phones", "Phones", line.phones.filter((phone) => phone[0] !== SILENT).map((phone) => this._phone(phone))),
      this._row("findings", "Findings and tags", [...line.findings.flatMap((f) => this._finding(f)), ...line.events.map((e) => this._event(e))]),
      this._curves.canvas,
      this._loop,
      this._head,
    );
    this._scroller = el("div", { class: "scroller" }, this._rows);
    const labels = { ruler: "s", wave: "Sound", words: "Words", phones: "Phones", findings: "Notes", curves: "Curves" };
    this.element = el(
      "section",
      { class: "timeline", "aria-label": "Timeline" },
      el("div", { class: "labels", "aria-hidden": true }, ...Object.entries(labels).map(([place, text]) => el("div", { class: place, text }))),
      this._scroller,
    );
    this._scroller.addEventListener("scroll", () => (this._drawn = ""));
    this._scroller.addEventListener("wheel", (event) => this._wheel(event), { passive: false });
    this._watcher = new ResizeObserver(() => this.layOut());
    this._watcher.observe(this._scroller);
    this._listenToPointer();
  }

  get length_s() {
    return Math.max(0.1, this._clock.end_s - this._clock.start_s);
  }

  get width() {
    return this._scroller.clientWidth || 800;
  }

  get px_per_s() {
    return (this.width / this.length_s) * this.zoom;
  }

  close() {
    this._watcher.disconnect();
  }

  /** @param {string} kind @param {string} label @param {HTMLElement[]} marks */
  _row(kind, label, marks) {
    return el("div", { class: `row ${kind}`, role: "group", "aria-label": label }, ...marks);
  }

  /**
   * Something with a place on the time axis, that jumps there.
   *
   * @param {HTMLElement} mark
   * @param {number} start_s
   * @param {number} end_s
   */
  _placed(mark, start_s, end_s) {
    const from = (start_s - this._clock.start_s) / this.length_s;
    mark.style.left = `${from * 100}%`;
    mark.style.width = `${((end_s - start_s) / this.length_s) * 100}%`;
    return mark;
  }

  /** @param {WordData} word */
  _word([text, start_s, end_s]) {
    const mark = button(text, () => this._clock.seek(start_s), { title: `${text}: ${start_s.toFixed(2)}–${end_s.toFixed(2)} s; double-click repeats it` });
    mark.addEventListener("dblclick", () => {
      this._clock.setLoop([start_s, end_s]);
      this._clock.seek(start_s);
      this._clock.play();
    });
    return this._placed(mark, start_s, end_s);
  }

  /** @param {PhoneData} phone */
  _phone([symbol, ipa, start_s, end_s, score]) {
    const scored = score === null ? "no score" : `score ${score.toFixed(1)}`;
    const about = `${symbol}${ipa && ipa !== symbol ? ` /${ipa}/` : ""}, ${start_s.toFixed(2)}–${end_s.toFixed(2)} s, ${scored}`;
    const mark = button(symbol, () => this._clock.seek((start_s + end_s) / 2), { title: about });
    mark.setAttribute("aria-label", about);
    if (score !== null) {
      // Full colour for a poor score, none for a good one.
      mark.style.setProperty("--doubt", `${clamp((score / POOR_SCORE) * 100, 0, 100).toFixed(0)}%`);
    }
    if (BILABIALS.has(ipa)) mark.classList.add("closes");
    return this._placed(mark, start_s, end_s);
  }

  /** @param {FindingData} finding */
  _finding(finding) {
    if (!finding.when_s) return [];
    const [start_s, end_s] = finding.when_s;
    const mark = button(`${finding.severity}: ${finding.message}`, () => this._clock.seek(start_s), { icon: finding.severity === "info" ? "i" : "!", title: finding.message, class: finding.severity });
    return [this._placed(mark, start_s, Math.max(end_s, start_s + 0.02))];
  }

  /** @param {[string, number]} event */
  _event([tag, time_s]) {
    return this._placed(button(`[${tag}]`, () => this._clock.seek(time_s), { class: "tag" }), time_s, time_s + 0.25);
  }

  /** Zoom by a factor, about what is played, or about a place in sight. @param {number} factor @param {number} [x] */
  zoomBy(factor, x) {
    const about = x ?? clamp((this._clock.now_s - this._clock.start_s) * this.px_per_s - this._scroller.scrollLeft, 0, this.width);
    const at_s = (this._scroller.scrollLeft + about) / this.px_per_s;
    const most = Math.max(1, MOST_PX_PER_S / (this.width / this.length_s));
    this.zoom = clamp(this.zoom * factor, 1, most);
    this.layOut();
    this._scroller.scrollLeft = at_s * this.px_per_s - about;
  }

  layOut() {
    this._rows.style.width = `${Math.round(this.length_s * this.px_per_s)}px`;
    this._drawn = "";
  }

  /** @param {WheelEvent} event */
  _wheel(event) {
    if (!event.ctrlKey && !event.shiftKey) return;
    event.preventDefault();
    const box = this._scroller.getBoundingClientRect();
    if (event.ctrlKey) this.zoomBy(Math.exp(-event.deltaY / 300), event.clientX - box.left);
    else this._scroller.scrollLeft += event.deltaY || event.deltaX;
  }

  /** A press seeks; a drag over the sound or the curves repeats what it covers. */
  _listenToPointer() {
    /** @type {number | null} */
    let from_s = null;
    /** @param {PointerEvent} event */
    const timeAt = (event) => (event.clientX - this._rows.getBoundingClientRect().left) / this.px_per_s + this._clock.start_s;
    this._rows.addEventListener("pointerdown", (event) => {
      if (/** @type {HTMLElement} */ (event.target).closest("button") || event.button !== 0) return;
      from_s = timeAt(event);
      this._rows.setPointerCapture(event.pointerId);
      this._clock.seek(from_s);
    });
    this._rows.addEventListener("pointermove", (event) => {
      if (from_s === null) return;
      const to_s = timeAt(event);
      if (Math.abs(to_s - from_s) * this.px_per_s > 6) this._clock.setLoop([Math.min(from_s, to_s), Math.max(from_s, to_s)]);
    });
    this._rows.addEventListener("pointerup", () => {
      if (from_s !== null && this._clock.loop) this._clock.seek(this._clock.loop[0]);
      from_s = null;
    });
  }

  /** Once per picture. */
  draw() {
    const at_s = this._clock.now_s;
    const x = (at_s - this._clock.start_s) * this.px_per_s;
    if (this._clock.playing && (x < this._scroller.scrollLeft || x > this._scroller.scrollLeft + this.width * 0.95)) this._scroller.scrollLeft = x - this.width * 0.1;
    this._head.style.transform = `translateX(${x}px)`;
    const loop = this._clock.loop;
    this._loop.hidden = !loop;
    if (loop) {
      this._loop.style.transform = `translateX(${(loop[0] - this._clock.start_s) * this.px_per_s}px)`;
      this._loop.style.width = `${(loop[1] - loop[0]) * this.px_per_s}px`;
    }
    const state = `${this._scroller.scrollLeft}|${this.px_per_s}|${this.width}|${this._chosen.version}|${this._palette.faint}|${devicePixelRatio}`;
    if (state === this._drawn) return;
    this._drawn = state;
    this._drawLanes(this._scroller.scrollLeft / this.px_per_s + this._clock.start_s);
  }

  /** @param {number} from_s */
  _drawLanes(from_s) {
    const palette = this._palette;
    const ruler = this._ruler.begin(from_s, this.px_per_s, this.width);
    drawRuler(ruler.ink, ruler.sight, palette);
    const wave = this._wave.begin(from_s, this.px_per_s, this.width);
    drawGrid(wave.ink, wave.sight, palette);
    if (this.peaks && this._line.peaks) drawWave(wave.ink, wave.sight, palette, this.peaks, this._line.peaks.rate_hz);
    const { ink, sight } = this._curves.begin(from_s, this.px_per_s, this.width);
    this._drawClosures(ink, sight);
    drawGrid(ink, sight, palette);
    const [low, high] = this._chosen.range();
    const room = CURVES_HEIGHT - 16;
    /** @param {number} weight */
    const y = (weight) => 8 + room * (1 - (weight - low) / (high - low));
    ink.strokeStyle = palette.faint;
    ink.fillStyle = palette.faint;
    ink.font = "11px system-ui, sans-serif";
    for (let step = Math.ceil(low * 4); step <= high * 4; step++) {
      const level = Math.round(y(step / 4)) + 0.5;
      ink.globalAlpha = step === 0 ? 0.6 : 0.25;
      ink.beginPath();
      ink.moveTo(0, level);
      ink.lineTo(sight.width, level);
      ink.stroke();
      ink.globalAlpha = 1;
      ink.textBaseline = level < 16 ? "top" : "bottom";
      if (step !== 0) ink.fillText(`${step / 4}`, 4, level < 16 ? level + 2 : level - 1);
    }
    const keys = this.px_per_s > 500;
    for (const { take, column, colour, strong } of this._chosen.curves()) {
      drawCurve(ink, sight, take, column, y, { colour, strong, dashed: take.side === "B", keys });
    }
  }

  /** Where lips have to be shut. @param {CanvasRenderingContext2D} ink @param {Sight} sight */
  _drawClosures(ink, sight) {
    ink.fillStyle = this._palette.closure;
    for (const [, ipa, start_s, end_s] of this._line.phones) {
      if (BILABIALS.has(ipa)) ink.fillRect(xOf(sight, start_s), 0, (end_s - start_s) * sight.px_per_s, sight.height);
    }
  }
}
