// One clock for sound and pictures.

/** Where playing is; seconds on the recording's time axis. */
class Clock {
  /**
   * @param {HTMLAudioElement | null} audio - None: the clock runs by itself
   * @param {number} start_s - of the time axis; before 0 there is no sound
   * @param {number} end_s
   */
  constructor(audio, start_s, end_s) {
    this.audio = audio;
    this.start_s = start_s;
    this.end_s = end_s;
    this.rate = 1;
    /** @type {[number, number] | null} */
    this.loop = null;
    this.playing = false;
    this._at_s = Math.max(0, start_s);
    this._before_ms = 0;
    this._sought = true;
    /** @type {(() => void)[]} */
    this.watchers = [];
    this.silent = "";
    if (audio) {
      audio.preservesPitch = true;
      audio.addEventListener("error", () => {
        this.audio = null;
        this.silent = "The recording is not heard: this browser found no sound output, or cannot read it. The clock runs without it.";
        this._tell();
      });
    }
  }

  get now_s() {
    return this._at_s;
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    const [from, to] = this.loop ?? [this.start_s, this.end_s];
    if (this._at_s >= to - 0.005 || (this.loop && this._at_s < from)) this.seek(from);
    this.playing = true;
    this._before_ms = performance.now();
    this._follow();
    this._tell();
  }

  pause() {
    this.playing = false;
    this.audio?.pause();
    this.seek(this._at_s);
  }

  /** @param {number} at_s */
  seek(at_s) {
    this._at_s = clamp(at_s, this.start_s, this.end_s);
    this._sought = true;
    if (this.audio) {
      this.audio.currentTime = Math.max(0, this._at_s);
      if (this.playing) this._follow();
    }
    this._tell();
  }

  /** @param {number} frames @param {number} frame_hz */
  step(frames, frame_hz) {
    if (this.playing) this.pause();
    this.seek((Math.round(this._at_s * frame_hz) + frames) / frame_hz);
  }

  /** @param {number} rate */
  setRate(rate) {
    this.rate = rate;
    if (this.audio) this.audio.playbackRate = rate;
    this._tell();
  }

  /** @param {[number, number] | null} loop */
  setLoop(loop) {
    this.loop = loop && loop[1] - loop[0] > 0.02 ? [clamp(loop[0], this.start_s, this.end_s), clamp(loop[1], this.start_s, this.end_s)] : null;
    this._tell();
  }

  /** Once per picture: go on. @param {number} now_ms */
  tick(now_ms) {
    const passed_s = Math.min(0.25, (now_ms - this._before_ms) / 1000) * this.rate;
    this._before_ms = now_ms;
    if (!this.playing) return;
    const before_s = this._at_s;
    this._at_s += passed_s;
    const audio = this.audio;
    if (audio && !audio.paused) {
      // The audio's own time comes in steps, and late where sound is slow to start (Firefox): follow it
      // smoothly, wait for it if it is far behind, jump if it is far ahead; never go back.
      const ahead_s = audio.seeking ? -Infinity : audio.currentTime - this._at_s;
      if (ahead_s > 0.1) this._at_s = audio.currentTime;
      else this._at_s = ahead_s < -0.1 ? before_s : Math.max(before_s, this._at_s + ahead_s * 0.12);
    } else if (audio && !audio.ended && this._at_s >= 0 && this._at_s < audio.duration) {
      this._follow(); // sound that has ended would begin anew
    }
    const [from, to] = this.loop ?? [this.start_s, this.end_s];
    if (this._at_s >= to) {
      if (this.loop) this.seek(from);
      else {
        this._at_s = to;
        this.pause();
      }
    }
  }

  /** Let the sound play where the clock is. */
  _follow() {
    const audio = this.audio;
    if (!audio || this._at_s < 0 || this._at_s >= (audio.duration || Infinity)) {
      audio?.pause();
      return;
    }
    audio.playbackRate = this.rate;
    if (audio.paused) {
      if (this._sought || Math.abs(audio.currentTime - this._at_s) > 0.1) audio.currentTime = this._at_s;
      this._sought = false;
      audio.play().catch(() => this.pause());
    }
  }

  _tell() {
    this.watchers.forEach((told) => told());
  }
}
