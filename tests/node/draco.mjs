// three.js's DRACOLoader under Node: what it asks of a browser, made of what Node has.
import { resolveObjectURL } from "node:buffer";
import { readFileSync } from "node:fs";
import { Cache } from "three";
import { DRACOLoader } from "three/addons/loaders/DRACOLoader.js";

// A worker that works here: nobody waits for the screen.
class Worker {
  constructor(url) {
    const self = Object.create(globalThis);
    self.postMessage = (data) => this.onmessage({ data });
    this.ready = resolveObjectURL(url)
      .text()
      // Without a process: the decoder would take it for CommonJS, and require files.
      .then((code) => new Function("self", "process", `let onmessage; ${code}; return onmessage;`))
      .then((start) => start(self, undefined));
  }
  postMessage(data) {
    const copy = structuredClone(data);
    this.ready.then((onmessage) => onmessage({ data: copy }));
  }
  terminate() {}
}

// Google's decoder: the older one that comes with three.js gives up on some of its own encoder's.
const find = (name) => import.meta.resolve(`draco3dgltf/${name}`);
const decoder = {
  js: find("draco_decoder_gltf_nodejs.js"),
  wasm: find("draco_decoder_gltf.wasm"),
};

export function dracoLoader() {
  globalThis.Worker ??= Worker;
  // Node fetches no files; what is in the cache is not fetched.
  Cache.enabled = true;
  Cache.add(`file:${decoder.js}`, readFileSync(new URL(decoder.js), "utf-8"));
  Cache.add(`file:${decoder.wasm}`, new Uint8Array(readFileSync(new URL(decoder.wasm))).buffer);
  return new DRACOLoader().setDecoderPath(decoder);
}
