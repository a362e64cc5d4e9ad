// What is drawn on the canvases of the timeline: ruler, waveform, curves.

/**
 * Part of the time axis that is in sight.
 * @typedef {{from_s: number, px_per_s: number, width: number, height: number}} Sight
 */

/** A canvas as wide as what is in sight, sharp on every screen. */
class Lane {
  /** @param {string} name @param {number} height - in CSS pixels */
  constructor(name, height) {
    this.canvas = /** @type {HTMLCanvasElement} */ (el("canvas", { class: `lane ${name}`, "aria-hidden": true }));
    this.height = height;
    this.canvas.style.height = `${height}px`;
  }

  /**
   * An empty canvas to draw on.
   *
   * @param {number} from_s
   * @param {number} px_per_s
   * @param {number} width
   * @returns {{ink: CanvasRenderingContext2D, sight: Sight}}
   */
  begin(from_s, px_per_s, width) {
    const scale = devicePixelRatio || 1;
    const [w, h] = [Math.round(width * scale), Math.round(this.height * scale)];
    if (this.canvas.width !== w || this.canvas.height !== h) {
      this.canvas.width = w;
      this.canvas.height = h;
      this.canvas.style.width = `${width}px`;
    }
    const ink = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    ink.setTransform(scale, 0, 0, scale, 0, 0);
    ink.clearRect(0, 0, width, this.height);
    return { ink, sight: { from_s, px_per_s, width, height: this.height } };
  }
}

/** @param {Sight} sight @param {number} at_s */
function xOf(sight, at_s) {
  return (at_s - sight.from_s) * sight.px_per_s;
}

/** Steps of a ruler in seconds, the first that leaves room for its label. @param {number} px_per_s */
function rulerStep(px_per_s) {
  const steps = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 60];
  return steps.find((step) => step * px_per_s >= 64) ?? 120;
}

/** @param {CanvasRenderingContext2D} ink @param {Sight} sight @param {Palette} palette */
function drawRuler(ink, sight, palette) {
  const step = rulerStep(sight.px_per_s);
  ink.strokeStyle = palette.line;
  ink.fillStyle = palette.faint;
  ink.font = "11px system-ui, sans-serif";
  ink.textBaseline = "middle";
  ink.lineWidth = 1;
  const first = Math.floor(sight.from_s / step);
  for (let number = first; xOf(sight, number * step) < sight.width; number++) {
    const x = Math.round(xOf(sight, number * step)) + 0.5;
    ink.beginPath();
    ink.moveTo(x, sight.height - 7);
    ink.lineTo(x, sight.height);
    ink.stroke();
    const digits = step < 0.1 ? 2 : step < 1 ? 1 : 0;
    ink.fillText(`${(number * step).toFixed(digits)}`, x + 4, sight.height / 2);
  }
}

/** @param {CanvasRenderingContext2D} ink @param {Sight} sight @param {Palette} palette */
function drawGrid(ink, sight, palette) {
  const step = rulerStep(sight.px_per_s);
  ink.strokeStyle = palette.line;
  ink.lineWidth = 1;
  ink.beginPath();
  for (let number = Math.ceil(sight.from_s / step); xOf(sight, number * step) < sight.width; number++) {
    const x = Math.round(xOf(sight, number * step)) + 0.5;
    ink.moveTo(x, 0);
    ink.lineTo(x, sight.height);
  }
  ink.stroke();
}

/**
 * @param {CanvasRenderingContext2D} ink
 * @param {Sight} sight
 * @param {Palette} palette
 * @param {Int8Array} peaks - lowest and highest sample in turn
 * @param {number} rate_hz
 */
function drawWave(ink, sight, palette, peaks, rate_hz) {
  const middle = sight.height / 2;
  const count = peaks.length / 2;
  ink.fillStyle = palette.wave;
  for (let x = 0; x < sight.width; x++) {
    const from = Math.floor((sight.from_s + x / sight.px_per_s) * rate_hz);
    const to = Math.max(from + 1, Math.ceil((sight.from_s + (x + 1) / sight.px_per_s) * rate_hz));
    let low = 0;
    let high = 0;
    for (let at = Math.max(0, from); at < Math.min(to, count); at++) {
      low = Math.min(low, peaks[2 * at] ?? 0);
      high = Math.max(high, peaks[2 * at + 1] ?? 0);
    }
    if (to < 0 || from >= count) continue;
    const [top, bottom] = [middle - (high / 127) * middle, middle - (low / 127) * middle];
    ink.fillRect(x, Math.min(top, middle - 0.5), 1, Math.max(1, bottom - top));
  }
}

/**
 * One curve, from key to key.
 *
 * @param {CanvasRenderingContext2D} ink
 * @param {Sight} sight
 * @param {Take} take
 * @param {number} column
 * @param {(weight: number) => number} y
 * @param {{colour: string, dashed: boolean, strong: boolean, keys: boolean}} look
 */
function drawCurve(ink, sight, take, column, y, look) {
  const columns = take.names.length;
  const left_s = sight.from_s + take.lead_s;
  const first = Math.max(0, lastBefore(take.times_s, left_s));
  ink.strokeStyle = look.colour;
  ink.fillStyle = look.colour;
  ink.lineWidth = look.strong ? 2.5 : 1.5;
  ink.lineJoin = "round";
  ink.setLineDash(look.dashed ? [5, 4] : []);
  ink.beginPath();
  /** @param {number} at */
  const weight = (at) => /** @type {number} */ (take.weights[at * columns + column]);
  ink.moveTo(0, y(weight(first)));
  /** @type {[number, number][]} */
  const keys = [];
  let x = 0;
  let at = first;
  for (; at < take.times_s.length; at++) {
    x = xOf(sight, /** @type {number} */ (take.times_s[at]) - take.lead_s);
    ink.lineTo(x, y(weight(at)));
    keys.push([x, y(weight(at))]);
    if (x > sight.width) break;
  }
  if (x < sight.width) ink.lineTo(sight.width, y(weight(take.times_s.length - 1)));
  ink.stroke();
  ink.setLineDash([]);
  if (look.keys) for (const [kx, ky] of keys) ink.fillRect(kx - 1.5, ky - 1.5, 3, 3);
}
