// The heads: one canvas, one clock, as many heads as there are sides.

/**
 * @typedef {{glb: string, faces: number, notes: string[],
 *   meshes: {node: number, shapes: string[], rest: number[]}[]}} AssetData
 * @typedef {{set: (weights: ArrayLike<number>) => void}} Head
 * @typedef {{add: (glb: ArrayBuffer, digest: string, asset: AssetData, names: string[]) => Promise<Head>,
 *   clear: () => void, draw: () => void, look: (from: string) => void, close: () => void}} Stage3d
 * @typedef {{stage: (canvas: HTMLCanvasElement) => Stage3d}} HeadLibrary
 */

const LOOKS = /** @type {[string, string][]} */ ([
  ["front", "Front"],
  ["quarter", "¾"],
  ["side", "Side"],
  ["mouth", "Mouth"],
]);

/** @returns {HeadLibrary | undefined} */
function headLibrary() {
  return /** @type {any} */ (globalThis).animemeHead;
}

/** @param {string} digest @returns {AssetData | undefined} */
function assetOf(digest) {
  return /** @type {any} */ (globalThis).animemeAssets?.[digest];
}

/** @param {AssetData} asset @returns {Promise<ArrayBuffer>} */
async function glbOf(asset) {
  const zipped = new Blob([bytesOf(asset.glb)]).stream();
  return new Response(zipped.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

/** What shows the heads, or says why they are not shown. */
class Heads {
  /** @param {string} title - of what is seen, for screen readers */
  constructor(title) {
    this.canvas = /** @type {HTMLCanvasElement} */ (el("canvas", { class: "head", role: "img", "aria-label": title }));
    this._says = el("p", { class: "says" });
    this._names = el("div", { class: "names" });
    this._looks = LOOKS.map(([look, text]) => button(text, () => this._look(look), { pressed: look === "front", title: `Look from here: ${text}` }));
    this.element = el("section", { class: "stage", "aria-label": "Head" }, this.canvas, this._says, this._names, el("div", { class: "looks", role: "group", "aria-label": "View" }, ...this._looks));
    /** @type {Stage3d | null} */
    this._stage = null;
    /** @type {{take: Take, head: Head}[]} */
    this._heads = [];
    this._turn = 0;
  }

  /** @param {string} look */
  _look(look) {
    this._stage?.look(look);
    LOOKS.forEach(([name], at) => this._looks[at]?.setAttribute("aria-pressed", String(name === look)));
  }

  /** @param {string} why */
  _give(why) {
    this._says.textContent = why;
    this.element.classList.add("none");
  }

  /**
   * Show some takes beside each other.
   *
   * @param {Take[]} takes
   * @param {string} why - what to say if there is nothing to be shown
   */
  async show(takes, why) {
    const library = headLibrary();
    const shown = takes.filter((take) => take.asset && assetOf(take.asset));
    if (!library || !shown.length) return this._give(why || "There is no head to be shown.");
    try {
      this._stage ??= library.stage(this.canvas);
    } catch {
      return this._give("This browser has no WebGL, so the head is not shown; everything else works.");
    }
    const turn = ++this._turn;
    this.element.classList.add("loading");
    this._stage.clear();
    this._heads = [];
    const notes = new Set();
    try {
      for (const take of shown) {
        const digest = /** @type {string} */ (take.asset);
        const asset = /** @type {AssetData} */ (assetOf(digest));
        const head = await this._stage.add(await glbOf(asset), digest, asset, take.names);
        if (turn !== this._turn) return;
        this._heads.push({ take, head });
        asset.notes.forEach((note) => notes.add(note));
      }
    } catch (error) {
      return this._give(`The head cannot be shown: ${error instanceof Error ? error.message : error}.`);
    }
    this.element.classList.remove("loading", "none");
    this._says.textContent = [...notes].join(" ");
    this._names.replaceChildren(...shown.map((take) => el("span", {}, el("b", { text: takes.length > 1 ? `${take.side} · ${take.title} · ${take.file}` : take.file }))));
    this.element.dataset["ready"] = String(shown.length);
  }

  /** Once per picture: the weights of now. */
  draw() {
    if (!this._heads.length) return;
    for (const { take, head } of this._heads) head.set(take.now);
    this._stage?.draw();
  }

  close() {
    this._turn++;
    this._stage?.close();
  }
}
