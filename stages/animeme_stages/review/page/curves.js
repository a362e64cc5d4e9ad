// The weights that are stored in a file, and what they are between keys.

/**
 * @typedef {{side: string, title: string, file: string, asset: string | null, audio_start_s: number,
 *   names: string[], times_s: string, weights: string}} TakeData
 */

// Marks of what speech moves, in most families of rigs.
const SPOKEN = /jaw|mouth|lip|tongue|viseme|^v_|phon|maw|^aa$|^ih$|^ou$|^ee$|^oh$/i;

/** Curves of one file, linear between keys and constant beyond them. */
class Take {
  /** @param {TakeData} data */
  constructor(data) {
    this.side = data.side;
    this.title = data.title;
    this.file = data.file;
    this.asset = data.asset;
    this.lead_s = data.audio_start_s;
    this.names = data.names;
    this.times_s = new Float32Array(bytesOf(data.times_s).buffer);
    this.weights = new Float32Array(bytesOf(data.weights).buffer); // row by row
    this.now = new Float32Array(this.names.length);
  }

  get end_s() {
    return this.times_s[this.times_s.length - 1] ?? 0;
  }

  /**
   * All weights at a time, in `now`.
   *
   * @param {number} at_s - on the recording's time axis
   */
  sample(at_s) {
    const time = at_s + this.lead_s;
    const columns = this.names.length;
    const last = this.times_s.length - 1;
    const left = clamp(lastBefore(this.times_s, time), 0, last);
    const right = Math.min(left + 1, last);
    const from = /** @type {number} */ (this.times_s[left]);
    const span = /** @type {number} */ (this.times_s[right]) - from;
    const part = span > 0 ? clamp((time - from) / span, 0, 1) : 0;
    for (let column = 0; column < columns; column++) {
      const low = /** @type {number} */ (this.weights[left * columns + column]);
      const high = /** @type {number} */ (this.weights[right * columns + column]);
      this.now[column] = low + (high - low) * part;
    }
    return this.now;
  }

  /** Lowest and highest weight of a curve. @param {number} column @returns {[number, number]} */
  range(column) {
    let low = Infinity;
    let high = -Infinity;
    for (let at = column; at < this.weights.length; at += this.names.length) {
      low = Math.min(low, /** @type {number} */ (this.weights[at]));
      high = Math.max(high, /** @type {number} */ (this.weights[at]));
    }
    return [low, high];
  }

  /** Names of the curves, those that move most first; those that speech moves before others. */
  ranked() {
    const moved = new Map(
      this.names.map((name, column) => {
        const [low, high] = this.range(column);
        return [name, high - low];
      }),
    );
    /** @param {string} name */
    const worth = (name) => (SPOKEN.test(name) ? 10 : 0) + (moved.get(name) ?? 0);
    return [...this.names].sort((a, b) => worth(b) - worth(a));
  }
}
