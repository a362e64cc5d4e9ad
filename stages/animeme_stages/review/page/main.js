// What this page is: the list, a line, or both in one file.

/**
 * @typedef {{index?: IndexData, line?: LineData, around?: Around, title?: string,
 *   lines?: Record<string, LineData>, sounds?: Record<string, string>}} PageData
 */

/** @param {PageData} data */
function start(data) {
  const root = /** @type {HTMLElement} */ (document.getElementById("app"));
  const marks = new Marks(data.title ?? data.index?.title ?? "", !data.lines);
  if (data.line && data.around) {
    root.className = "line-page";
    const { up, before, after } = data.around;
    /** @param {string | null} href */
    const from = (href) => (href === null ? null : `${up}/${href}`);
    const around = { up: `${up}/index.html`, before: from(before), after: from(after) };
    new LineView(root, data.line, around, marks, (name) => `${up}/${name}`);
    return;
  }
  /** @type {{close: () => void} | null} */
  let shown = null;
  const names = Object.keys(data.lines ?? {});
  const turn = () => {
    shown?.close();
    marks.watchers.length = 0;
    const name = decodeURIComponent(location.hash.slice(1));
    const line = data.lines?.[name];
    root.className = line ? "line-page" : "index-page";
    if (!line) {
      shown = new IndexView(root, /** @type {IndexData} */ (data.index), marks);
      return;
    }
    const at = names.indexOf(name);
    /** @param {number} place */
    const href = (place) => (names[place] === undefined ? null : `#${encodeURIComponent(names[place])}`);
    const around = { up: "#", before: href(at - 1), after: href(at + 1) };
    shown = new LineView(root, line, around, marks, (sound) => data.sounds?.[sound.replace(/^sound:/, "")] ?? "");
    scrollTo(0, 0);
  };
  addEventListener("hashchange", turn);
  turn();
}

// All scripts of the page have run by then, those of the head among them.
addEventListener("DOMContentLoaded", () => {
  const told = document.getElementById("data")?.textContent ?? "{}";
  start(JSON.parse(told));
});
